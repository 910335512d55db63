"""Steps of a control tick, against those of `cfem.motion.step` and finite differences."""

import numpy as np
import pytest
from control.motion.bar import DT, clocked, robot, standing
from motion.test_linear import moving

from cfem.motion.clocked import ClockedState
from cfem.motion.linear import Guess, MaterialShares, places
from cfem.motion.modes import natural_modes
from cfem.motion.step import MotionCommand, step

KINDS = ["force", "displacement"]


def begun(kind):
    """A robot that moves, without the scaling of its frequency, and the next command."""
    tick, (motion, u) = clocked(kind), moving(robot(), kind, 0.2)
    tick._warp = 1.0
    reached = u if kind == "force" else motion.q[:1]
    return tick, motion, ClockedState(np.concatenate([motion.q, motion.p, motion.memory.ravel()]), motion.v, reached), u


def near(found, expected, share=1e-4):
    np.testing.assert_allclose(found, expected, atol=share * np.abs(expected).max())


@pytest.mark.parametrize("kind", KINDS)
def test_a_tick_is_a_step_under_the_mean_force_or_to_the_displacement(kind):
    tick, motion, state, u = begun(kind)
    target = 1.3 * u
    told = (state.u + target) / 2 if kind == "force" else target
    expected = step(robot(), motion, MotionCommand(**{kind: told}), DT, tolerance=1e-10)
    n_q, there = robot().n_q, places(robot(), (state.z[:1] + DT / 2 * expected.v[:1])[None])
    after, steps, _ = tick.step(state, target, MaterialShares(), there)
    near(after.z[:n_q], expected.q)
    near(after.z[n_q:], expected.p)
    near(after.v, expected.v)
    assert after.u == target
    guess = Guess(state.z[None], after.v[None], np.array([told]))
    near(tick.linear(guess, MaterialShares())[0].end[0], after.z)
    if kind == "displacement":
        near(steps.lam[0], expected.lam)


@pytest.mark.parametrize("kind", KINDS)
def test_inertia_is_that_where_the_last_velocity_leads_to(kind):
    tick, _, state, u = begun(kind)
    middle = state.z[:1] + DT / 2 * state.v[:1] if kind == "force" else (state.z[:1] + 1.3 * u) / 2
    np.testing.assert_allclose(tick.step(state, 1.3 * u, MaterialShares())[2].M[0], robot().at(middle).M, rtol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("dt", [1e-3, 8e-3])
def test_the_lowest_frequency_is_right_however_long_a_tick_is(kind, dt):
    """Without viscosity the slope of a step turns the first mode by 2 pi f dt."""
    tick, rest = clocked(kind, dt), standing(2.4 if kind == "force" else 1.5, kind)
    tick.model = type("Lossless", (), {"losses": (), "__getattr__": lambda self, name: getattr(robot(), name)})()
    state = tick.at_rest(rest)
    A = tick.step(state, state.u, MaterialShares())[1].A[0]
    at = natural_modes(robot(), np.array([1.5]), kind == "displacement", 1).frequency[0]
    turns = np.abs(np.angle(np.linalg.eigvals(A))) / (2 * np.pi * dt)
    assert np.abs(turns - at).min() < 2e-2 * at
    assert tick.frequency == pytest.approx(at)


def test_what_stands_stays():
    tick, rest = clocked("force"), standing(2.4)
    state = tick.at_rest(rest)
    np.testing.assert_allclose(state.z[:1], rest.delta_a)
    np.testing.assert_allclose(state.u, rest.lambda_a)
    np.testing.assert_allclose(tick.step(state, state.u, MaterialShares())[0].z, state.z, atol=1e-6)
    assert clocked("displacement").at_rest(rest).u == rest.delta_a


def test_effectors_are_the_model_s_and_their_slopes_its_differences():
    tick, n_q = clocked("force"), robot().n_q
    z = np.zeros((2, tick.n_z))
    z[:, 0], z[:, 1:n_q] = (1.3, 1.6), 0.5 * np.random.default_rng(1).normal(size=(2, n_q - 1))
    found, C = tick.effectors(z)
    for value, one in zip(found, z, strict=True):
        np.testing.assert_allclose(value, robot().at(one[:1]).effectors(one[1:n_q]), atol=1e-9)
    h, given = 1e-5, places(robot(), z[:, :1])
    for k in range(1, n_q):
        ends = [tick.effectors(z + sign * h * np.eye(tick.n_z)[k], given)[0] for sign in (1, -1)]
        np.testing.assert_allclose(C[:, :, k], (ends[0] - ends[1]) / (2 * h), atol=1e-7)
    assert not C[:, :, n_q:].any()
    z[:, 2:n_q] = z[:, 1:n_q] = 0.0  # without inner motions the slope of E by the place counts nothing
    ends = [tick.effectors(z + sign * h * np.eye(tick.n_z)[0])[0] for sign in (1, -1)]
    np.testing.assert_allclose(tick.effectors(z)[1][:, :, 0], (ends[0] - ends[1]) / (2 * h), atol=1e-6)
