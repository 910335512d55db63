"""Nearest points of triangles against a minimisation over their corners' shares; volumes and normals of boxes."""

import numpy as np
from scipy.optimize import nnls
from scipy.spatial import ConvexHull

from cfem.contact.surface.triangles import closest, mean_normals, volumes_within


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


def test_a_box_with_a_void_holds_their_volumes_and_has_normals_along_its_diagonals():
    box = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    hull = ConvexHull(box)
    a, b, c = (box[hull.simplices[:, i]] for i in range(3))
    inwards = ((np.cross(b - a, c - a) * hull.equations[:, :3]).sum(axis=1) < 0)[:, None]
    outer = np.where(inwards, hull.simplices[:, ::-1], hull.simplices)
    X = np.concatenate([3 * box, box]) + [7.0, -2.0, 5.0]
    triangles, part = np.concatenate([outer, outer[:, ::-1] + 8]), np.repeat([0, 1], 12)
    np.testing.assert_allclose(volumes_within(X, triangles, part), [6.0**3, -(2.0**3)])
    normals = mean_normals(X, triangles)
    assert ((normals[:8] * box).sum(axis=1) > 0).all()
    assert ((normals[8:] * box).sum(axis=1) < 0).all()
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0)
