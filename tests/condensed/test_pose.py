"""Poses against scipy's rotations and finite differences."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from cfem.condensed import Condensed, Rows
from cfem.condensed.pose import Patch, from_energy, onto_patch, resting, slopes_onto_patch
from cfem.condensed.rotation import turn

ANGLES = st.lists(st.floats(-2.0, 2.0), min_size=3, max_size=3).map(np.array)


@settings(max_examples=30, deadline=None)
@given(ANGLES)
def test_points_turn_as_scipy_turns_them(theta):
    np.testing.assert_allclose(turn(theta).R, Rotation.from_rotvec(theta).as_matrix(), atol=1e-13)


@settings(max_examples=20, deadline=None)
@given(ANGLES)
def test_derivatives_agree_with_finite_differences(theta):
    h = 1e-5
    steps = h * np.eye(3)
    first = [(turn(theta + d).R - turn(theta - d).R) / (2 * h) for d in steps]
    np.testing.assert_allclose(turn(theta).first, first, atol=1e-8)
    second = [(turn(theta + d).first - turn(theta - d).first) / (2 * h) for d in steps]
    np.testing.assert_allclose(turn(theta).second, second, atol=1e-8)


@pytest.mark.parametrize("turns", [True, False])
def test_a_patch_moves_rigidly_and_its_derivatives_agree(turns):
    points = np.array([[0.0, 20, -98], [1.732, 20, -101], [-1.732, 20, -101]])
    patch = Patch(points, points.mean(axis=0), turns)
    rng = np.random.default_rng(1)
    X, lam, h = 0.3 * rng.standard_normal(patch.n), rng.standard_normal(9), 1e-5
    moved = points + patch.displacement(X).reshape(-1, 3)
    apart = np.linalg.norm(moved - np.roll(moved, 1, axis=0), axis=1)
    np.testing.assert_allclose(apart, np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1), rtol=1e-13)
    np.testing.assert_allclose(moved.mean(axis=0), patch.origin + X[:3], atol=1e-12)
    steps = h * np.eye(patch.n)
    first = np.stack([(patch.displacement(X + d) - patch.displacement(X - d)) / (2 * h) for d in steps], axis=1)
    np.testing.assert_allclose(patch.jacobian(X), first, atol=1e-8)
    slope = np.stack([lam @ (patch.jacobian(X + d) - patch.jacobian(X - d)) / (2 * h) for d in steps], axis=1)
    np.testing.assert_allclose(patch.curvature(X, lam), slope, atol=1e-8)


N_A = 2
POINTS = np.array([[0.0, 2, 1], [1.7, 2, -1], [-1.7, 2, -1]])
N = N_A + 9
RNG = np.random.default_rng(0)
ROOT = RNG.standard_normal((N, N))
STIFF = ROOT @ ROOT.T / N + np.eye(N)
CUBIC = 0.05 * RNG.standard_normal((4, N))
EFFECTOR = RNG.standard_normal((3, N))
BEND = 0.1 * RNG.standard_normal((3, N, N))
BEND += BEND.swapaxes(1, 2)


def energy(d):
    """Psi, grad, Hessian, third derivative of a quadratic with four cubic ridges."""
    ridge = CUBIC @ d
    psi = d @ STIFF @ d / 2 + (ridge**3).sum()
    gradient = STIFF @ d + 3 * CUBIC.T @ ridge**2
    return psi, gradient, STIFF + 6 * np.einsum("r,ri,rj->ij", ridge, CUBIC, CUBIC)


def points_model(d):
    """Condensed model of actuators and point rows at d (11,)."""
    _, lam, hessian = energy(d)
    e = EFFECTOR @ d + np.einsum("eij,i,j->e", BEND, d, d) / 2
    G = EFFECTOR + BEND @ d
    locked = np.eye(3) * (1 + 0.1 * d[0])
    rows = Rows(("x", "y", "z"), ("a", "b"), tuple(f"c{i}" for i in range(9)))
    return from_energy(rows, np.concatenate([e, d]), lam, hessian, G, locked)


def point_slopes(d, h=1e-5):
    """dW/dlambda by central differences along the path."""
    W = points_model(d).W[3:, 3:]
    by_d = np.stack([(points_model(d + s).W - points_model(d - s).W) / (2 * h) for s in h * np.eye(N)])
    return np.einsum("lk,lij->kij", W, by_d)


def at_pose(patch, t):
    return np.concatenate([t[:N_A], patch.displacement(t[N_A:])])


@pytest.mark.parametrize("turns", [True, False])
def test_the_pose_has_the_energy_of_its_points(turns):
    patch = Patch(POINTS, POINTS.mean(axis=0), turns)
    t = 0.3 * np.random.default_rng(3).standard_normal(N_A + patch.n)
    h = 1e-5
    found = onto_patch(points_model(at_pose(patch, t)), patch, t[N_A:])
    steps = h * np.eye(len(t))
    psi = [[energy(at_pose(patch, t + s * step))[0] for s in (1, -1)] for step in steps]
    np.testing.assert_allclose(found.lam, [(p - m) / (2 * h) for p, m in psi], atol=1e-8)

    def state(t):
        at = onto_patch(points_model(at_pose(patch, t)), patch, t[N_A:])
        return at.lam, at.delta_e

    slopes = [[state(t + s * step) for s in (1, -1)] for step in steps]
    hessian = np.stack([(p[0] - m[0]) / (2 * h) for p, m in slopes], axis=1)
    active = found.rows.active
    np.testing.assert_allclose(np.linalg.inv(found.W[active, active]), hessian, atol=1e-8)
    gradient_e = np.stack([(p[1] - m[1]) / (2 * h) for p, m in slopes], axis=1)
    np.testing.assert_allclose(found.effector_jacobian, gradient_e, atol=1e-8)
    np.testing.assert_allclose(found.delta[active], t, atol=1e-12)


@pytest.mark.parametrize("turns", [True, False])
def test_slopes_of_W_agree_with_finite_differences(turns):
    patch = Patch(POINTS, POINTS.mean(axis=0), turns)
    t = 0.2 * np.random.default_rng(4).standard_normal(N_A + patch.n)
    h = 1e-5

    def W(t):
        return onto_patch(points_model(at_pose(patch, t)), patch, t[N_A:]).W

    by_t = np.stack([(W(t + s) - W(t - s)) / (2 * h) for s in h * np.eye(len(t))])
    expected = np.einsum("wk,wij->kij", W(t)[3:, 3:], by_t)
    d = at_pose(patch, t)
    found = slopes_onto_patch(points_model(d), point_slopes(d), patch, t[N_A:])
    np.testing.assert_allclose(found, expected, atol=3e-7 * np.abs(expected).max())


def test_a_lone_actuator_keeps_its_compliance_when_the_patch_is_free():
    patch = Patch(POINTS, POINTS.mean(axis=0), False)
    found = onto_patch(points_model(np.zeros(N)), patch, np.zeros(3))
    assert isinstance(found, Condensed)
    assert np.linalg.eigvalsh(found.W).min() > 0


@pytest.mark.parametrize("free", [[2], [1, 3], [0, 1, 2, 3]])
def test_the_free_coordinates_carry_nothing(free):
    """The wrench that holds the pose under these forces vanishes on the free coordinates."""
    rng = np.random.default_rng(1)
    root = rng.normal(size=(6, 6))
    W, n_a, n = root @ root.T + np.eye(6), 2, 4
    forces, pose = rng.normal(size=n_a), rng.normal(size=n)
    pose[free] = 0.0
    pose += resting(W, n_a, free) @ np.concatenate([forces, pose])
    wrench = np.linalg.solve(W[n_a:, n_a:], pose - W[n_a:, :n_a] @ forces)
    np.testing.assert_allclose(wrench[free], 0.0, atol=1e-12)
