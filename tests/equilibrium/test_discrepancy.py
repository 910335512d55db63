"""Equilibria of a robot with a discrepancy: W and dW are derivatives of whole solves."""

from dataclasses import replace

import numpy as np
import pytest
from support.blocks import bar

from cfem.condensed.discrepancy import Discrepancy, terms_of
from cfem.core.errors import SpecError
from cfem.equilibrium.motion.inertia import mass_of
from cfem.equilibrium.newton import NewtonSettings
from cfem.equilibrium.solve import Wanted, solve
from cfem.equilibrium.system import actuation
from cfem.equilibrium.system.problem import Problem

EXACT = NewtonSettings(tolerance=1e-12)


@pytest.fixture(scope="module")
def robot():
    plain = bar(divisions=(5, 1, 1), poisson=0.4)
    n = plain.rows.n_a
    weights = np.random.default_rng(7).standard_normal((len(terms_of(n)), 2))
    rows = (plain.rows.effectors[0], plain.rows.effectors[2])
    return replace(plain, discrepancy=Discrepancy(rows, np.full(n, 2.0), weights))


@pytest.fixture(scope="module")
def state(robot):
    solved = solve(Problem(robot), actuation.displacement([1.0, 2.0]), settings=EXACT, wanted=Wanted(third_order=True))
    assert solved.converged and (np.abs(solved.lambda_a) < 2.0).all()
    return solved


def at_force(robot, lam, start):
    return solve(Problem(robot), actuation.force(lam), start.state, None, EXACT)


def test_it_moves_the_effectors_it_names_and_nothing_else(robot, state):
    plain = solve(Problem(replace(robot, discrepancy=None)), actuation.displacement([1.0, 2.0]), settings=EXACT)
    shift = state.delta_e - plain.delta_e
    np.testing.assert_allclose(shift[[0, 2]], robot.discrepancy.value(state.lambda_a), atol=1e-9)
    assert np.abs(shift[1]) < 1e-12
    np.testing.assert_allclose(state.condensed.delta_e, state.delta_e, atol=1e-9)
    np.testing.assert_allclose(state.condensed.locked_compliance, plain.condensed.locked_compliance, rtol=1e-7)


def test_the_compliance_stays_symmetric_and_definite(state):
    W = state.condensed.W
    np.testing.assert_allclose(W, W.T, rtol=1e-12)
    assert np.linalg.eigvalsh(W).min() > -1e-9 * np.abs(W).max()


def test_effectors_follow_the_forces_as_W_says(robot, state):
    lam, h = state.state.lam, 1e-4
    for k in range(robot.rows.n_a):
        ahead, behind = (at_force(robot, lam + sign * h * np.eye(len(lam))[k], state) for sign in (1, -1))
        slope = (ahead.delta_e - behind.delta_e) / (2 * h)
        np.testing.assert_allclose(state.condensed.W_ea[:, k], slope, atol=1e-6 * np.abs(slope).max())


def test_dW_is_the_derivative_along_whole_solves(robot, state):
    lam = state.state.lam
    for k in range(robot.rows.n_a):

        def slope(h, k=k):
            ahead, behind = (at_force(robot, lam + sign * h * np.eye(len(lam))[k], state) for sign in (1, -1))
            return (ahead.condensed.W - behind.condensed.W) / (2 * h)

        h = 2e-2 * np.abs(lam).max()
        expected = (4 * slope(h / 2) - slope(h)) / 3
        np.testing.assert_allclose(state.dW[k], expected, rtol=0, atol=2e-6 * np.abs(expected).max())


def test_what_it_says_nothing_about_is_refused(robot):
    wanted = Wanted(mass=mass_of(replace(robot, density=1e-9)))
    with pytest.raises(SpecError, match="says nothing about mass"):
        solve(Problem(robot), actuation.displacement([1.0, 2.0]), wanted=wanted)
