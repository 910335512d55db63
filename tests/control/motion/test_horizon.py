"""The program of a horizon: condensing against running the steps, bounds, obstacles."""

import numpy as np
import pytest
from control.motion.bar import clocked, standing
from scipy.optimize import minimize

from cfem.control.motion.horizon import (
    Bounds,
    HalfSpace,
    HorizonCost,
    Predicted,
    _softened,
    best_commands,
    condensed_forces,
    condensed_states,
)
from cfem.control.search.qp import QpStatus
from cfem.motion.linear import Guess, MaterialShares
from cfem.motion.mpc_spec import blocks

N = 6
FREE = Bounds(np.array([[-np.inf, np.inf]]), np.array([np.inf]), np.array([[-np.inf, np.inf]]))


def steps_of(kind):
    at = clocked(kind)
    state = at.at_rest(standing(2.4 if kind == "force" else 1.5, kind))
    guess = Guess(np.repeat(state.z[None], N, 0), np.zeros((N, at.n_q)), np.repeat(state.u[None], N, 0))
    return at, state, guess, at.linear(guess, MaterialShares())[0]


@pytest.mark.parametrize("kind", ["force", "displacement"])
def test_condensed_states_are_those_of_the_steps_one_by_one(kind):
    at, state, guess, steps = steps_of(kind)
    rng = np.random.default_rng(0)
    told = state.u * 1.02
    U = state.u * (1 + 0.1 * rng.standard_normal((N, 1)))
    z = state.z
    found = condensed_states(steps, z, guess.state, guess.u, told, kind == "force")
    forces = None if kind == "force" else condensed_forces(steps, found, z, guess.state, guess.u)
    before = told
    for k in range(N):
        acting = at.acting(before, U[k])
        if forces is not None:
            lam = steps.lam[k] + steps.lam_by_z[k] @ (z - guess.state[k]) + steps.lam_by_u[k] @ (acting - guess.u[k])
            np.testing.assert_allclose(forces.at(U.ravel())[k], lam, rtol=1e-9)
        z = steps.end[k] + steps.A[k] @ (z - guess.state[k]) + steps.B[k] @ (acting - guess.u[k])
        np.testing.assert_allclose(found.at(U.ravel())[k], z, rtol=1e-9, atol=1e-12)
        before = U[k]


def effectors(kind="force"):
    at, state, guess, steps = steps_of(kind)
    states = condensed_states(steps, state.z, guess.state, guess.u, state.u, kind == "force")
    e, C = at.effectors(guess.state)
    value = e + np.einsum("kij,kj->ki", C, states.value - guess.state)
    return state, Predicted(value, C @ states.slope)


COST = HorizonCost(np.ones(3), np.array([0.3]), np.array([0.0]))


def solved(bounds, away=0.3, backend="active_set"):
    state, found = effectors()
    rest = found.at(np.repeat(state.u, N))
    goals = rest + away * np.array([-1.0, 0.0, -2.0])
    return state, found, best_commands(found, None, goals, state.u, state.u, COST, bounds, backend)


def test_bounds_and_rates_hold():
    state, _, free = solved(FREE)
    assert free.qp.status is QpStatus.OPTIMAL and free.U.max() > 1.15 * state.u[0]
    tight = Bounds(np.array([[0.0, 1.1 * state.u[0]]]), np.array([0.05]), FREE.course)
    _, _, held = solved(tight)
    steps = np.diff(np.concatenate([state.u[None], held.U]), axis=0)
    assert held.U.max() <= 1.1 * state.u[0] + 1e-9 and np.abs(steps).max() <= 0.05 + 1e-9
    assert np.abs(steps).max() == pytest.approx(0.05)


def test_commands_held_in_blocks_are_those_of_equal_commands():
    """The same program with equalities instead of blocks, by another solver."""
    begins = blocks(N, 3)
    assert begins.tolist() == [0, 1, 2] and blocks(20, 8).tolist() == [0, 1, 2, 3, 4, 6, 8, 13]
    assert blocks(20, 20).tolist() == blocks(20, 50).tolist() == list(range(20)) and blocks(20, 1).tolist() == [0]
    state, found = effectors()
    goals = found.at(np.repeat(state.u, N)) + np.array([-0.3, 0.0, -0.6])
    held = best_commands(found, None, goals, state.u, state.u, COST, FREE, begins=begins)
    assert np.ptp(held.U[2:]) == 0 and np.ptp(held.U) > 0.05

    def cost(V):
        U = np.repeat(V, [1, 1, N - 2])
        missed = goals - found.at(U)
        steps = np.diff(np.concatenate([state.u, U]))
        return 0.5 * (missed**2).sum() + 0.5 * COST.smooth[0] ** 2 * (steps**2).sum()

    best = minimize(cost, state.u.repeat(3), tol=1e-14).x
    np.testing.assert_allclose(held.U[[0, 1, 2], 0], best, atol=1e-4)


def test_two_solvers_agree():
    tight = Bounds(np.array([[0.0, 2.6]]), np.array([0.1]), FREE.course)
    ours, other = solved(tight)[2], solved(tight, backend="osqp")[2]
    np.testing.assert_allclose(ours.U, other.U, atol=1e-5)


def test_an_obstacle_is_not_passed():
    _state, found, free = solved(FREE)
    normal = np.array([0.0, 0.0, 1.0])
    level = found.at(free.U.ravel())[:, 2].min() + 0.05
    _, _, held = solved(Bounds(FREE.command, FREE.rate, FREE.course, (HalfSpace(normal, level),)))
    assert not held.softened
    assert (found.at(held.U.ravel()) @ normal).min() >= level - 1e-9


def test_an_obstacle_that_cannot_be_avoided_widens_as_little_as_it_can():
    state, found, _ = solved(FREE)
    now = found.at(np.repeat(state.u, N))[0, 2]
    wall = HalfSpace(np.array([0.0, 0.0, 1.0]), now + 1.0)  # the tip is a millimetre behind it already
    slow = Bounds(np.array([[0.0, 5.0]]), np.array([0.1]), FREE.course, (wall,))
    _, _, held = solved(slow)
    assert held.softened and held.qp.status is QpStatus.OPTIMAL
    fastest = state.u[0] - 0.1 * np.arange(1, N + 1)
    np.testing.assert_allclose(held.U[:, 0], fastest, atol=5e-2)


def test_bounds_that_give_way_do_so_alike_in_any_unit():
    rng = np.random.default_rng(0)
    M, d, A, box = rng.normal(size=(6, 3)), rng.normal(size=6), rng.normal(size=(2, 3)), np.tile([-1.0, 1.0], (3, 1))
    low, high = np.array([5.0, 5.0]), np.array([6.0, 6.0])  # beyond what the box allows

    def commands(unit):
        return _softened(M, d, unit * A, unit * low, unit * high, box, 0, "active_set").x[:3]

    np.testing.assert_allclose(commands(1e-3), commands(1e3), atol=1e-8)
    nearest = minimize(lambda x: ((np.maximum(low - A @ x, 0)) ** 2).sum(), np.zeros(3), bounds=box).x
    np.testing.assert_allclose(A @ commands(1.0), A @ nearest, atol=1e-3)
