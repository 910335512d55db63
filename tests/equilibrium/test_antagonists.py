"""Cables that oppose each other: equilibria against the raw conditions and the same states by force, and their cost."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from support.fast_cases import fast_are
from support.trunks import trunk

from cfem.core.spec import load_spec
from cfem.equilibrium.newton import NewtonSettings
from cfem.equilibrium.predictor import knot, predict
from cfem.equilibrium.solve import Wanted, solve
from cfem.equilibrium.system.actuation import Actuation, displacement, force, pulling_only
from cfem.equilibrium.system.problem import Problem
from cfem.robot.build import build_robot
from cfem.robot.mesh.accuracy import scene_mesh
from cfem.robot.spec import SceneSpec

PIPELINES = Path(__file__).parents[2] / "pipelines"
TIGHT = NewtonSettings(tolerance=1e-11)
FEWEST = 6  # factorisations of a state, on average


@cache
def problem_of(name, cells=4):
    if name.startswith("trunk-"):
        return Problem(trunk(int(name.removeprefix("trunk-")), divisions=cells))
    path = PIPELINES / name / "scene.yaml"
    scene = load_spec(path, SceneSpec, ["mesh.cells=200"])
    return Problem(build_robot(scene, scene_mesh(scene, path.parent)[0]))


def lengths(robot, x):
    """(n_a,) mm: of the cables, summed segment by segment."""
    found = []
    for cable in robot.actuators:
        ends = np.array([row @ x[cable.nodes] + start for row, start in zip(cable.along, cable.start, strict=True)])
        found.append(np.sqrt((ends**2).sum(axis=1)).sum())
    return np.array(found)


def assert_complementary(robot, state, target):
    """From positions and tensions alone: no cable pushes or is longer than it was told, and one that is shorter, by
    `spare`, carries nothing."""
    assert state.converged, state.status.value
    told = lengths(robot, robot.X) - target
    spare, tension = told - lengths(robot, state.state.x), state.lambda_a
    tight, none = 1e-9 * robot.length, 1e-9 * tension.max(initial=0.0)
    assert spare.min() >= -tight and tension.min() >= -none
    assert ((spare <= tight) | (tension <= none)).all()
    np.testing.assert_array_equal(state.slack, tension <= max(none, 1e-14))


@pytest.mark.parametrize("cables", fast_are({3, 6}, range(3, 9)))
def test_random_lengths_of_a_trunks_cables_give_states_that_pull(cables):
    problem = problem_of(f"trunk-{cables}")
    robot, rng = problem.robot, np.random.default_rng(cables)
    counts, slack = [], 0
    for _ in range(4):
        target = rng.uniform(-0.2, 1.0, cables) * robot.reach[:, 1]
        state = solve(problem, displacement(target), settings=TIGHT)
        assert_complementary(robot, state, target)
        slack += state.slack.sum()
        counts.append(state.factorizations)
        by_force = solve(problem, force(state.lambda_a), state.state, settings=TIGHT)
        np.testing.assert_allclose(by_force.state.x, state.state.x, atol=1e-7 * robot.length)
        np.testing.assert_allclose(
            by_force.condensed.W, state.condensed.W, rtol=1e-5, atol=1e-5 * np.abs(state.condensed.W).max()
        )
    assert slack > 0 and max(counts) <= 2 * FEWEST, counts


def test_the_same_state_by_force_from_rest():
    """On a path that knows nothing of lengths."""
    problem = problem_of("trunk-4")
    state = solve(problem, displacement([8.0, 0.0, 3.0, 1.0]), settings=TIGHT)
    by_force = solve(problem, force(state.lambda_a), settings=TIGHT)
    assert by_force.converged
    np.testing.assert_allclose(by_force.state.x, state.state.x, atol=1e-7)
    np.testing.assert_allclose(by_force.delta_a, state.delta_a, atol=1e-7)


@pytest.mark.parametrize("cables", fast_are({5}, [3, 5, 8]))
def test_states_in_a_row_start_from_those_before(cables):
    problem = problem_of(f"trunk-{cables}")
    robot, rng = problem.robot, np.random.default_rng(1)
    knots, counts = [], []
    for row in rng.random((15, cables)):
        asked = pulling_only(displacement(row * robot.reach[:, 1]), robot.unilateral)
        start = predict(knots, row, asked)
        if start is not None:  # no more than one row pushes by rounding, of the prediction already
            assert start.lam.min() >= 0.0
        state = solve(problem, asked, start)
        assert_complementary(robot, state, asked.target)
        knots.append(knot(row, state))
        counts.append(state.factorizations)
    assert np.mean(counts) <= FEWEST, counts


@pytest.mark.slow
@pytest.mark.parametrize("name", ["diamond", "trunk"])
def test_robots_of_the_catalogue(name):
    problem = problem_of(name)
    robot = problem.robot
    counts = []
    for row in np.random.default_rng(0).random((3, robot.rows.n_a)):
        target = 0.5 * row * robot.reach[:, 1]
        state = solve(problem, displacement(target))
        assert_complementary(robot, state, target)
        counts.append(state.factorizations)
    assert np.mean(counts) <= FEWEST, counts


def test_a_trunk_that_hangs_aside_is_held_by_the_cables_above_alone():
    heavy = Problem(trunk(4, divisions=4, weight=0.05))
    state = solve(heavy, displacement(np.zeros(4)))
    assert_complementary(heavy.robot, state, np.zeros(4))
    assert 0 < state.slack.sum() < 4


def test_cables_at_rest_at_their_own_lengths_carry_nothing():
    problem = problem_of("trunk-4")
    state = solve(problem, displacement(np.zeros(4)))
    assert_complementary(problem.robot, state, np.zeros(4))
    assert state.slack.all() and np.abs(state.delta_e).max() < 1e-12


def test_a_cable_that_is_told_just_the_length_it_has_carries_nothing():
    problem = problem_of("trunk-4")
    bent = solve(problem, force([0.3, 0.1, 0.0, 0.0]), settings=TIGHT)
    again = solve(problem, displacement(bent.delta_a), settings=TIGHT)
    assert_complementary(problem.robot, again, bent.delta_a)
    np.testing.assert_allclose(again.lambda_a, [0.3, 0.1, 0.0, 0.0], atol=1e-7)
    for by in (1e-6, -1e-6):
        near = solve(problem, displacement(bent.delta_a + [0, 0, by, 0]), settings=TIGHT)
        assert_complementary(problem.robot, near, bent.delta_a + [0, 0, by, 0])
        assert (near.lambda_a[2] > 0) == (by > 0)


def test_a_cable_of_a_mixture_is_let_go_and_others_hold_their_forces():
    """Two cables by length, one by force, one whose length is held from both sides by a row of two."""
    problem = problem_of("trunk-4")
    how = Actuation(np.eye(4)[:2], np.array([6.0, -6.0]), np.array([0.0, 0.0, 0.2, 0.1]))
    state = solve(problem, how, settings=TIGHT)
    assert state.converged and state.slack.tolist() == [False, True, False, False]
    assert state.delta_a[0] == pytest.approx(6.0, abs=1e-9) and state.delta_a[1] > -6.0
    np.testing.assert_allclose(state.lambda_a[2:], [0.2, 0.1], rtol=1e-12)


def test_cables_that_may_push_do():
    problem = problem_of("trunk-4")
    state = solve(problem, displacement([3.0, 0.0, 0.0, 0.0]), slack=False)
    assert state.converged and state.lambda_a.min() < 0
    np.testing.assert_allclose(state.delta_a, [3.0, 0.0, 0.0, 0.0], atol=1e-9)


def test_derivatives_are_those_with_the_taut_cables_held():
    problem = problem_of("trunk-4")
    target = np.array([8.0, 0.0, -2.0, 0.0])
    state = solve(problem, displacement(target), settings=TIGHT, wanted=Wanted(keep=True))
    taut, h = ~state.slack, 1e-3
    assert 0 < taut.sum() < 4
    np.testing.assert_array_equal(np.abs(state.linear.C).sum(axis=0) > 0, taut)
    W = state.condensed.W_aa
    slopes = np.zeros((4, 4))
    slopes[np.ix_(taut, taut)] = np.linalg.inv(W[np.ix_(taut, taut)])
    for j in np.flatnonzero(taut):
        ahead, behind = (
            solve(problem, displacement(target + s * h * np.eye(4)[j]), state.state, settings=TIGHT) for s in (1, -1)
        )
        np.testing.assert_allclose((ahead.lambda_a - behind.lambda_a) / (2 * h), slopes[:, j], rtol=1e-4, atol=1e-7)
