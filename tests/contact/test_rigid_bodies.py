"""Motions and levers of rigid bodies, against rotations of SciPy and cross products."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cfem.contact.rigid_bodies import RigidBodies, add_wrench, carried, motions

RNG = np.random.default_rng(1)


@pytest.mark.parametrize("size", [0.0, 1e-9, 1e-7, 1e-5, 0.3, 2.5])
def test_bodies_turn_about_their_centres(size):
    centres, xi = 50 * RNG.normal(size=(2, 3)), RNG.normal(size=12)
    xi[3:6] = size * np.array([2.0, -1.0, 2.0]) / 3
    R, t = motions(xi, centres)
    xi = xi.reshape(2, 6)
    np.testing.assert_allclose(R, Rotation.from_rotvec(xi[:, 3:]).as_matrix(), atol=1e-15, rtol=0)
    moved = (R @ centres[:, :, None])[:, :, 0] + t
    np.testing.assert_allclose(moved, centres + xi[:, :3], atol=1e-13)


def test_what_is_fixed_to_a_body_moves_with_it_and_its_forces_act_on_that():
    R, R_begin = (Rotation.random(2, rng=RNG).as_matrix() for _ in range(2))
    t, t_begin, point = RNG.normal(size=(2, 3)), RNG.normal(size=(2, 3)), RNG.normal(size=3)
    R_end, t_end = carried(np.array([1, -1]), R, t, R_begin, t_begin)
    expected = R[1] @ (R_begin[0] @ point + t_begin[0]) + t[1]
    np.testing.assert_allclose(R_end[0] @ point + t_end[0], expected, atol=1e-14)
    np.testing.assert_array_equal(R_end[1], R_begin[1])
    np.testing.assert_array_equal(t_end[1], t_begin[1])
    wrench, lever, force = np.zeros(12), RNG.normal(size=3), RNG.normal(size=3)
    for body in (1, -1):
        add_wrench(wrench, body, lever, force)
    np.testing.assert_allclose(wrench, [0.0] * 6 + [*force, *np.cross(lever, force)], atol=1e-15)


def test_levers_tell_how_points_move_and_what_stands_still_has_none():
    centres, points, xi = RNG.normal(size=(2, 3)), RNG.normal(size=(3, 3)), RNG.normal(size=(2, 6))
    bodies = np.array([1, -1, 0])
    G = RigidBodies(centres, np.eye(12), np.zeros(12), bodies, bodies).levers(bodies, points)
    for lever, body, point in zip(G, bodies, points, strict=True):
        motion = xi[body, :3] + np.cross(xi[body, 3:], point - centres[body]) if body >= 0 else 0.0
        np.testing.assert_allclose(lever @ xi.ravel(), motion, atol=1e-14)
