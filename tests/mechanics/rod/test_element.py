"""The element of constant strain: derivatives by finite differences, rigid motions, and what it is exact for."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from cfem.mechanics.rod.element import curvature, screw, stretch

H = np.full(4, 2.0)


def pairs(angle, seed=0):
    """Frames of four elements, sheared and stretched at random, turned by `angle` from end to end."""
    rng = np.random.default_rng(seed)
    axis = rng.standard_normal((4, 3))
    Ra = Rotation.from_rotvec(rng.standard_normal((4, 3)))
    Rb = Ra * Rotation.from_rotvec(angle * axis / np.linalg.norm(axis, axis=1)[:, None])
    ca = rng.standard_normal((4, 3))
    return ca, Ra, ca + Ra.apply([2.0, 0.0, 0.0] + 0.5 * rng.standard_normal((4, 3))), Rb


def at(frames, q=None):
    ca, Ra, cb, Rb = frames
    q = np.zeros((4, 12)) if q is None else q
    Ra, Rb = Rotation.from_rotvec(q[:, 3:6]) * Ra, Rotation.from_rotvec(q[:, 9:]) * Rb
    return stretch(ca + q[:, :3], Ra.as_matrix(), cb + q[:, 6:9], Rb.as_matrix(), H)


@pytest.mark.parametrize("angle", [0.0, 1e-4, 0.3, 2.5])
def test_gradient_and_curvature_are_derivatives(angle):
    frames, rng = pairs(angle), np.random.default_rng(1)
    v, w, h = rng.standard_normal((4, 12)), rng.standard_normal((4, 6)), 2e-3
    e = {k: at(frames, k * h * v).e for k in range(-2, 3)}
    slope = (8 * (e[1] - e[-1]) - (e[2] - e[-2])) / (12 * h)
    second = (-e[2] + 16 * e[1] - 30 * e[0] + 16 * e[-1] - e[-2]) / (12 * h * h)
    here = at(frames)
    np.testing.assert_allclose(np.einsum("mij,mj->mi", here.gradient, v), slope, atol=2e-9)
    K = curvature(here, w)
    np.testing.assert_allclose(K, K.swapaxes(1, 2), atol=1e-14)
    np.testing.assert_allclose(np.einsum("mi,mij,mj->m", v, K, v), (w * second).sum(axis=1), atol=1e-6)


def test_a_rigid_motion_of_both_ends_strains_nothing():
    ca, Ra, cb, Rb = pairs(0.7)
    turn, shift = Rotation.from_rotvec([2.0, -1.0, 0.4]), np.array([3.0, 5.0, -4.0])
    moved = turn.apply(ca) + shift, turn * Ra, turn.apply(cb) + shift, turn * Rb
    np.testing.assert_allclose(at(moved).e, at((ca, Ra, cb, Rb)).e, atol=1e-13)


@pytest.mark.parametrize("size", [0.0, 1e-5, 0.02, 1.5])
def test_the_strain_is_the_logarithm_of_the_motion(size):
    """Against the exponential of 4 x 4 matrices."""
    e = size * np.random.default_rng(2).standard_normal((4, 6)) / 2
    p, turn = screw(e, H)
    for k in range(4):
        twist = np.zeros((4, 4))
        x, y, z = e[k, 3:]
        twist[:3, :3] = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
        twist[:3, 3] = e[k, :3] + [H[k], 0, 0]
        whole = expm(twist)
        np.testing.assert_allclose(turn[k], whole[:3, :3], atol=1e-14)
        np.testing.assert_allclose(p[k], whole[:3, 3], atol=1e-14)
    origin, still = np.zeros((4, 3)), np.tile(np.eye(3), (4, 1, 1))
    np.testing.assert_allclose(stretch(origin, still, p, turn, H).e, e, atol=1e-14)
