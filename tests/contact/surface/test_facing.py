"""What faces what across a gap."""

import numpy as np
import pytest
from support.blocks import block

from cfem.contact.surface.facing import facing

CENTRE = np.full((1, 3), 1 / 3)


def stacked(gap, turn=0.0):
    """Two boxes of 4 x 4 x 1 mm, their meshes unlike, the upper one `gap` mm above the lower one and turned about y at
    its lower edge x = 0."""
    low, high = block((4, 4, 1), (2, 3, 1)), block((4, 4, 1), (3, 2, 1))
    c, s = np.cos(turn), np.sin(turn)
    tilted = high.X @ np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]]).T
    return np.concatenate([low.X, tilted + [0, 0, 1 + gap]]), np.concatenate([low.facets, high.facets + len(low.X)])


def test_points_of_both_sides_have_the_place_straight_before_them():
    X, triangles = stacked(0.5)
    face, place, partner, partner_place = facing(X, triangles, CENTRE, 0.6)
    points = np.einsum("kc,kci->ki", place, X[triangles[face]])
    partners = np.einsum("kc,kci->ki", partner_place, X[triangles[partner]])
    rise = np.where(points[:, 2] < 1.2, 0.5, -0.5)
    np.testing.assert_allclose(partners - points, rise[:, None] * [0, 0, 1], atol=1e-6)
    assert (rise > 0).sum() == 2 * 2 * 3 and (rise < 0).sum() == 2 * 3 * 2  # all triangles of both sides


@pytest.mark.parametrize(("gap", "turn", "within"), [(0.5, 0.0, 0.4), (0.5, np.radians(-70), 9.0)])
def test_what_is_far_away_or_stands_steeply_has_no_partner(gap, turn, within):
    X, triangles = stacked(gap, turn)
    assert not len(facing(X, triangles, CENTRE, within)[0])


def test_what_lies_behind_a_face_is_none():
    """The opposite sides of one box face away from each other, through the material."""
    box = block((4, 4, 1), (2, 2, 1))
    assert not len(facing(box.X, box.facets, CENTRE, 10.0)[0])


def test_portions_of_rays_give_the_same_pairs(monkeypatch):
    X, triangles = stacked(0.5)
    whole = facing(X, triangles, CENTRE, 0.6)
    monkeypatch.setattr("cfem.contact.surface.crossing.PORTION", 7)
    for part, expected in zip(facing(X, triangles, CENTRE, 0.6), whole, strict=True):
        np.testing.assert_array_equal(part, expected)
