"""A goal is out of reach where the optimality conditions of the nonlinear problem say so, whatever ended the search."""

import numpy as np
import pytest
from support.analytic_robot import ARMS, AnalyticRobot

from cfem.condensed.strokes import ridge_of
from cfem.control.search.goal_search import Iterate, SearchSettings, SearchStatus, search_goal
from cfem.control.search.inverse import Aim, Limits
from cfem.control.search.optimality import Optimality, Verdict, arrived

ROBOT = AnalyticRobot(ARMS["cables"], [20.0, 3000.0, 0.5])
LIMITS = Limits.of(ROBOT.reach, ROBOT.unilateral)
IMAGE = ROBOT.length * ROBOT.arm.effector(np.array([0.6, 0.1, 0.4]))
BEYOND = 1.5 * IMAGE + np.array([0.0, 0.0, 30.0])


def aim(goal, regularisation=1e-10, damping=0.0):
    ridge, held = (ridge_of(value, ROBOT.reach, ROBOT.length) for value in (regularisation, damping))
    return Aim(goal, np.ones(3), ridge, damping=held)


def search(goal, regularisation=1e-10, damping=0.0, **settings):
    settings = SearchSettings.of(ROBOT.reach, **{"iterations": 40, **settings})
    start = Iterate.at(ROBOT.at_displacement(np.zeros(3)))
    return search_goal(ROBOT, aim(goal, regularisation, damping), LIMITS, start, settings)


def test_the_nearest_point_is_told_from_all_others():
    """Nearest by a grid of admissible states, which knows of no slope."""
    shares = np.stack(np.meshgrid(*[np.linspace(0, 1, 41)] * 3), axis=-1).reshape(-1, 3)
    shares = shares[ROBOT.admissible(shares)]
    apart = np.linalg.norm(ROBOT.length * ROBOT.arm.effector(shares) - BEYOND, axis=1)
    found = search(BEYOND)
    assert found.distance <= apart.min() + 1e-9 and found.distance > 0.9 * apart.min()
    assert found.verdict() is Verdict.OUT_OF_REACH
    far = shares[apart > 1.2 * apart.min()][::97]
    shown = [Optimality.of(ROBOT.at_displacement(s * ROBOT.strokes), aim(BEYOND), LIMITS).holds for s in far]
    assert len(far) > 50 and not any(shown)


def test_an_image_is_reached_and_no_optimum_is_asked_for():
    found = search(IMAGE)
    assert arrived(found.iterate.condensed, found.aim, LIMITS) and found.verdict() is Verdict.REACHED
    assert found.verdict(reached=False) is Verdict.NOT_CONVERGED  # the linearised robot comes to the goal


def test_a_miss_is_none_below_a_ten_thousandth_of_what_a_stroke_moves():
    """The farthest that any of the actuators moves the tip over its stroke, by finite differences."""
    u = 0.5 * ROBOT.reach.mean(axis=1)
    state, step = ROBOT.at_displacement(u), 1e-4 * ROBOT.reach[:, 1]
    ends = [[ROBOT.at_displacement(u + side * way).delta_e for side in (-1, 1)] for way in np.diag(step)]
    course = np.ptp(ROBOT.reach, axis=1)
    moved = max(np.linalg.norm(b - a) / (2 * h) * c for (a, b), h, c in zip(ends, step, course, strict=True))
    aside = np.array([0.0, 0.6, 0.8]) * 1e-4 * moved
    assert arrived(state, aim(state.delta_e + 0.98 * aside), LIMITS)
    assert not arrived(state, aim(state.delta_e + 1.02 * aside), LIMITS)


@pytest.mark.parametrize(
    "settings",
    [{"tolerance": 1e3}, {"regularisation": 1e3}, {"iterations": 1}, {"step": 1e-4}, {"regularisation": 1e-1}],
    ids=str,
)
@pytest.mark.parametrize("goal", [IMAGE, BEYOND], ids=["image", "beyond"])
def test_what_stops_a_search_early_is_no_verdict_on_the_goal(goal, settings):
    found = search(goal, **settings)
    assert found.distance > 1.0
    assert found.verdict(reached=False) is Verdict.NOT_CONVERGED


def test_damping_slows_a_search_and_changes_no_verdict():
    found = search(BEYOND, damping=1e-4, iterations=200)
    assert found.verdict() is Verdict.OUT_OF_REACH


def test_a_search_that_failed_says_nothing_of_its_goal():
    found = Iterate.at(search(BEYOND).iterate.condensed)  # the very optimum
    for status in (SearchStatus.NO_ANSWER, SearchStatus.QP_FAILED):
        stays = type(search(IMAGE)).stays(aim(BEYOND), LIMITS, found, status)
        assert stays.verdict(reached=False) is Verdict.NOT_CONVERGED
