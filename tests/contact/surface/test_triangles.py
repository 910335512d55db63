"""Nearest points of triangles, against a minimisation over their corners' shares."""

import numpy as np
from scipy.optimize import nnls

from cfem.contact.surface.triangles import closest


def test_no_share_of_the_corners_comes_nearer():
    """nnls solves the same with the sum of shares as a heavy equation."""
    rng = np.random.default_rng(0)
    corners, points = rng.normal(size=(200, 3, 3)), 2 * rng.normal(size=(200, 3))
    corners[0, 2] = corners[0, 1]  # a triangle that is a segment
    corners[1] = corners[1, 0]  # and one that is a point
    bary, distance = closest(corners, points)
    np.testing.assert_allclose(bary.sum(axis=1), 1, atol=1e-12)
    assert (bary >= 0).all()
    for triangle, point, found in zip(corners, points, distance, strict=True):
        shares, _ = nnls(np.vstack([triangle.T, np.full(3, 1e5)]), np.append(point, 1e5))
        assert abs(np.linalg.norm(shares @ triangle / shares.sum() - point) - found) < 1e-6


def test_one_point_for_all():
    corners = np.random.default_rng(1).normal(size=(20, 3, 3))
    point = np.array([0.1, 0.2, 0.3])
    for one, other in zip(closest(corners, point), closest(corners, np.tile(point, (20, 1))), strict=True):
        np.testing.assert_array_equal(one, other)
