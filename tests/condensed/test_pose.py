"""Poses against scipy's rotations and finite differences."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from cfem.condensed.pose import Patch
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
