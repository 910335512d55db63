"""Unknown forces on what moves: by what they mean, and against the steps of the dynamics."""

import numpy as np
import pytest
from control.motion.bar import clocked, robot, standing

from cfem.motion.estimation.pushes import effector_slope, mean_compliance, push_covariance, slope_by_force
from cfem.motion.linear import MaterialShares, places

DELTA = np.array([[1.5]])


@pytest.mark.parametrize("free", [slice(0, None), slice(1, None)])
@pytest.mark.parametrize("stiffness", [1.0, 1.4])
def test_at_rest_they_move_the_effectors_by_what_is_stated(free, stiffness):
    """Of a robot that yields to such forces until it is at rest: the root mean square of a coordinate."""
    place = places(robot(), DELTA)
    n_q = robot().n_q
    forces = push_covariance(np.eye(n_q), place, stiffness, free, 0.05)
    held = np.zeros((n_q, n_q))
    held[free, free] = np.linalg.inv(stiffness * place.K[0, free, free])
    moved = effector_slope(place) @ held @ forces @ held.T @ effector_slope(place).T
    assert np.sqrt(np.trace(moved) / len(moved)) == pytest.approx(0.05)
    np.testing.assert_allclose(forces, forces.T, atol=1e-12 * np.abs(forces).max())


def test_the_mean_compliance_is_that_of_forces_on_the_effectors():
    place, free = places(robot(), DELTA), slice(0, None)
    J = effector_slope(place)
    each = [force @ J @ np.linalg.solve(place.K[0], J.T @ force) for force in np.eye(3)]
    assert mean_compliance(place, free, place.K[0]) == pytest.approx(np.mean(each))
    np.testing.assert_allclose(J, np.hstack([place.J[0], place.H[0]]))


def test_a_force_is_half_a_step_of_momentum_before_and_half_after():
    """Against two steps of the dynamics: with the momentum that half a force gives, and without."""
    tick, rest, h = clocked(), standing(2.4), 1e-6
    state, n_q, dt = tick.at_rest(rest), robot().n_q, tick.dt
    A = tick.step(state, state.u, MaterialShares())[1].A[0]
    slope = slope_by_force(A, n_q, dt)
    for k in range(n_q):
        kick = np.zeros(tick.n_z)
        kick[n_q + k] = h * dt / 2
        ends = []
        for sign in (1, -1):
            begun = type(state)(state.z + sign * kick, state.v, state.u)
            ends.append(tick.step(begun, state.u, MaterialShares())[0].z + sign * kick)
        expected = (ends[0] - ends[1]) / (2 * h)
        np.testing.assert_allclose(slope[:, k], expected, atol=1e-4 * np.abs(expected).max())


def test_a_force_acts_on_momenta_alone_where_the_state_has_strains_that_relax_behind_them():
    """Positions, momenta and two inner strains: half of a force before the step, half after."""
    A, dt = np.random.default_rng(1).normal(size=(6, 6)), 0.1
    expected = dt / 2 * (A[:, 2:4] + np.eye(6)[:, 2:4])
    np.testing.assert_allclose(slope_by_force(A, 2, dt), expected)
