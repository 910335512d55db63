"""Searches over kinds of actuators, units, compliances and commands: the robot's own images are reached, goals beyond
get the nearest point, and the words agree. The nearest point is found by differential evolution on the closed form."""

from functools import cache

import numpy as np
import pytest
from scipy.optimize import differential_evolution, minimize
from support.analytic_robot import ARMS, AnalyticRobot

from cfem.condensed.strokes import ridge_of
from cfem.control.closed_loop.tick import Belief, Pilot, drive
from cfem.control.search.goal_search import SearchSettings
from cfem.control.search.inverse import Limits
from cfem.control.search.multistart import RESTARTS
from cfem.control.search.optimality import Verdict

REACHED = 1e-3  # of the length, as control.yaml has it for a robot of 100 mm
MIXED = (20.0, 3000.0, 0.5, 7.0)  # strokes of a cable in mm, a chamber in mm^3, ...
UNITS = (1e-3, 1.0, 20.0, 1e4, MIXED)
COMPLIANCES = (1e-2, 1.0, 10.0)
CHEAP = [("cables", MIXED, 1.0), ("chambers", 3000.0, 10.0), ("bellows", 1e4, 1.0), ("pushes", 1e-3, 1e-2)]
ALL = [(arm, unit, softness) for arm in ARMS for unit in UNITS for softness in COMPLIANCES]


def robot_of(arm, unit, compliance, form):
    return AnalyticRobot(ARMS[arm], np.broadcast_to(unit, 4)[: len(ARMS[arm].low)], compliance, form=form)


def pilot_of(robot, command):
    limits = Limits.of(robot.reach, robot.unilateral)
    ridge, settings = ridge_of(1e-10, robot.reach, robot.length), SearchSettings.of(robot.reach, 20)
    return Pilot(robot, command, "equilibrium", limits, np.ones(3), ridge, settings, restarts=RESTARTS)


def images(arm, count, rng):
    """(count, n_a) admissible shares, drawn uniformly."""
    found = np.zeros((0, len(arm.low)))
    while len(found) < count:
        shares = arm.low + (arm.high - arm.low) * rng.random((200, len(arm.low)))
        robot = AnalyticRobot(arm, 1.0)
        found = np.concatenate([found, shares[robot.admissible(shares)]])
    return found[:count]


@cache
def beyond(arm, count):
    """(count, 3) goals about the arm of length 1 that it cannot reach, and (count,) how near it gets to them."""
    rng, one = np.random.default_rng(5), ARMS[arm]
    robot, goals, nearest = AnalyticRobot(one, 1.0), [], []
    tips = one.effector(images(one, 200, rng))
    low, high = tips.min(axis=0) - 0.4, tips.max(axis=0) + 0.4
    while len(goals) < count:
        goal = low + (high - low) * rng.random(3)
        apart = _global(robot, goal)
        if apart > 20 * REACHED:
            goals.append(goal)
            nearest.append(apart)
    return np.array(goals), np.array(nearest)


def _global(robot, goal):
    arm = robot.arm

    def missed(shares):
        push = np.where(arm.unilateral, np.minimum(arm.force(shares.T), 0.0), 0.0)
        return np.linalg.norm(arm.effector(shares.T) - goal, axis=-1) + 10 * np.abs(push).sum(axis=-1)

    bounds = list(zip(arm.low, arm.high, strict=True))
    found = differential_evolution(
        missed, bounds, rng=1, maxiter=150, tol=1e-12, polish=False, vectorized=True, updating="deferred"
    )
    polished = minimize(
        lambda s: ((arm.effector(s) - goal) ** 2).sum(),
        found.x,
        method="SLSQP",
        bounds=bounds,
        constraints={"type": "ineq", "fun": lambda s: np.where(arm.unilateral, arm.force(s), 1.0)},
        options={"ftol": 1e-15, "maxiter": 300},
    )
    feasible = polished.success and missed(polished.x[:, None])[0] <= found.fun
    return float(np.sqrt(polished.fun)) if feasible else float(found.fun)


def demand_images_reached(case, form, command, count):
    robot = robot_of(*case, form)
    pilot, belief = pilot_of(robot, command), None
    belief = Belief.at(pilot, np.zeros(len(robot.strokes)))
    for shares in images(robot.arm, count, np.random.default_rng(1)):
        belief = drive(pilot, belief, robot.length * robot.arm.effector(shares))
        assert belief.plan.distance < REACHED * robot.length, shares
        assert belief.plan.verdict(belief.plan.distance < REACHED * robot.length) is Verdict.REACHED


def demand_nearest(case, form, command, count):
    robot = robot_of(*case, form)
    pilot = pilot_of(robot, command)
    belief = Belief.at(pilot, np.zeros(len(robot.strokes)))
    for goal, nearest in zip(*beyond(case[0], count), strict=True):
        belief = drive(pilot, belief, robot.length * goal)
        assert belief.plan.distance == pytest.approx(robot.length * nearest, rel=1e-3), goal
        assert belief.plan.verdict(reached=False) is Verdict.OUT_OF_REACH, goal
        assert belief.plan.limits.outside(np.zeros(3), belief.plan.lambda_a, robot.strokes) < 1e-6 * robot.energy
        assert belief.plan.limits.off_course(belief.plan.delta_a, robot.strokes) < 1e-5, goal


@pytest.mark.parametrize(("form", "command"), [("displacement", "displacement"), ("force", "force")])
@pytest.mark.parametrize("case", CHEAP, ids=str)
def test_images_of_the_robot_are_reached(case, form, command):
    demand_images_reached(case, form, command, 12)


@pytest.mark.parametrize("case", CHEAP, ids=str)
def test_goals_beyond_get_the_nearest_point_and_are_said_to_be_out_of_reach(case):
    demand_nearest(case, "displacement", "displacement", 4)


@pytest.mark.parametrize("case", CHEAP[:2], ids=str)
def test_steps_in_forces_keep_the_course_too(case):
    demand_nearest(case, "force", "force", 2)


@pytest.mark.slow
@pytest.mark.parametrize("form", ["displacement", "force"])
@pytest.mark.parametrize("command", ["displacement", "force"])
@pytest.mark.parametrize("case", ALL, ids=str)
def test_every_kind_reaches_its_images(case, form, command):
    demand_images_reached(case, form, command, 100)


@pytest.mark.slow
@pytest.mark.parametrize("form", ["displacement", "force"])
@pytest.mark.parametrize("command", ["displacement", "force"])
@pytest.mark.parametrize("case", ALL, ids=str)
def test_every_kind_gets_to_the_nearest_point_of_goals_beyond(case, form, command):
    demand_nearest(case, form, command, 12)
