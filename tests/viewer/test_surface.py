"""Points on sharp edges are there once for each side."""

import numpy as np
from export.pages import tube

from cfem.viewer.surface import sharpened

SKIN = tube(100.0)


def test_sharp_edges_part_a_surface_and_smooth_ones_do_not():
    """A cube whose faces are two triangles: each corner is lit from three sides. A round bar stays whole."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = np.array([t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))])
    again, parted = sharpened(corners, triangles, 100)
    assert sorted(again) == sorted([*range(8)] * 2)
    assert len(np.unique(parted)) == 24 and parted.max() == 100 + 15
    places = np.concatenate([corners, np.zeros((92, 3)), corners[again]])
    assert (places[parted] == corners[triangles]).all()
    for one in range(6):
        others = np.delete(parted, [2 * one, 2 * one + 1], axis=0)
        assert not np.isin(parted[2 * one : 2 * one + 2], others).any()
    again, parted = sharpened(SKIN["rest"], SKIN["triangles"], len(SKIN["rest"]))
    assert len(again) == 0 and (parted == SKIN["triangles"]).all()
