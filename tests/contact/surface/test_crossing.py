"""Where a surface passes through itself."""

import numpy as np
import pytest

from cfem.contact.surface.crossing import crossings

PLATE = np.array([[0.0, 0, 0], [4, 0, 0], [0, 4, 0]])


@pytest.mark.parametrize(
    ("low", "high", "x", "count"), [(-1, 1, 1.0, 2), (0.5, 1, 1.0, 0), (-1, 1, 3.0, 0), (-2, -1, 1.0, 0)]
)
def test_edges_that_pierce_a_plate(low, high, x, count):
    """A small triangle stands on the plate, through it, or beside it."""
    standing = np.array([[x, 1.0, low], [x + 0.2, 1.0, high], [x + 0.4, 1.0, low]])
    edges, pierced = crossings(np.vstack([PLATE, standing]), np.arange(6).reshape(2, 3))
    assert len(edges) == count
    assert (edges >= 3).all() and (pierced == 0).all()


def test_triangles_that_share_a_corner_or_lie_in_a_plane_do_not_cross():
    shared = np.vstack([PLATE, [[2.0, 2, 1], [2, 2, -1], [1, 1, 0], [2, 1, 0], [1, 2, 0]]])
    edges, _ = crossings(shared, np.array([[0, 1, 2], [5, 6, 7]]))
    assert len(edges) == 0
    edges, _ = crossings(shared, np.array([[0, 1, 2], [0, 3, 4]]))  # its far side passes through the plate's rim
    assert len(edges) == 0


def test_against_all_pairs():
    """Small and large triangles at random: the search by size leaves none out."""
    rng = np.random.default_rng(0)
    sizes = 10.0 ** rng.uniform(-1.5, 0.5, 120)
    X = (rng.random((120, 1, 3)) * 3 + sizes[:, None, None] * rng.standard_normal((120, 3, 3))).reshape(-1, 3)
    triangles = np.arange(360).reshape(-1, 3)
    edges, pierced = crossings(X, triangles)
    found = {(min(edge), max(edge), which) for edge, which in zip(edges.tolist(), pierced.tolist(), strict=True)}
    expected = set()
    for number, corners in enumerate(X[triangles]):
        normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        for a, b in triangles[:, [[0, 1], [1, 2], [0, 2]]].reshape(-1, 2):
            heights = (X[[a, b]] - corners[0]) @ normal
            if a // 3 == number or heights[0] * heights[1] >= 0:
                continue
            place = X[a] + (X[b] - X[a]) * heights[0] / (heights[0] - heights[1])
            turns = [np.cross(corners[(i + 1) % 3] - corners[i], place - corners[i]) @ normal for i in range(3)]
            if min(turns) > 0:
                expected.add((a, b, number))
    assert found == expected and len(found) > 100
