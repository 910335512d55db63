"""Motions and levers of rigid bodies, against rotations of SciPy and cross products."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cfem.contact.rigid_bodies import RigidBodies

RNG = np.random.default_rng(1)


@pytest.mark.parametrize("size", [0.0, 1e-9, 1e-7, 1e-5, 0.3, 2.5])
def test_bodies_turn_about_their_centres(size):
    centres, mobility = 50 * RNG.normal(size=(2, 3)), np.eye(12)
    wrench, before = RNG.normal(size=12), RNG.normal(size=12)
    wrench[3:6] = before[3:6] + size * np.array([2.0, -1.0, 2.0]) / 3
    R, t = RigidBodies(centres, mobility, before, np.zeros(0), np.zeros(0)).motions(wrench)
    xi = (wrench - before).reshape(2, 6)
    np.testing.assert_allclose(R, Rotation.from_rotvec(xi[:, 3:]).as_matrix(), atol=1e-15, rtol=0)
    moved = (R @ centres[:, :, None])[:, :, 0] + t
    np.testing.assert_allclose(moved, centres + xi[:, :3], atol=1e-13)


def test_levers_tell_how_points_move_and_what_stands_still_has_none():
    centres, points, xi = RNG.normal(size=(2, 3)), RNG.normal(size=(3, 3)), RNG.normal(size=(2, 6))
    bodies = np.array([1, -1, 0])
    G = RigidBodies(centres, np.eye(12), np.zeros(12), bodies, bodies).levers(bodies, points)
    for lever, body, point in zip(G, bodies, points, strict=True):
        motion = xi[body, :3] + np.cross(xi[body, 3:], point - centres[body]) if body >= 0 else 0.0
        np.testing.assert_allclose(lever @ xi.ravel(), motion, atol=1e-14)
