"""A robot with more actuators than coordinates to reach, whose published step is known in closed form."""

import numpy as np
import pytest
from support.analytic_robot import ARMS, AnalyticRobot

from cfem.condensed import Condensed, Rows
from cfem.condensed.strokes import ridge_of, stroke
from cfem.control.closed_loop.tick import STOPPED, Belief, Pilot, drive
from cfem.control.search.goal_search import SearchSettings
from cfem.control.search.inverse import Limits
from cfem.core.errors import InputError

ROWS = Rows(("tip.x",), ("one", "other"))
FREE = np.full((2, 2), np.inf) * [-1, 1]
CURVATURE, GOAL, RIDGE = 1.0, np.array([2.0]), np.full(2, 1e-3)


class Bowed:
    """e = d_1 - d_2^2 / 2 and lambda = delta_a. Of all states at e = g the nearest to rest is (g, 0); beside it
    d_1 grows by d_2^2 / 2."""

    def at_displacement(self, delta_a: np.ndarray) -> Condensed:
        W = np.eye(3)
        W[0, 1:] = W[1:, 0] = 1.0, -CURVATURE * delta_a[1]
        e = delta_a[0] - CURVATURE * delta_a[1] ** 2 / 2
        free = np.concatenate([[e], delta_a]) - W[:, 1:] @ delta_a
        return Condensed(ROWS, W, free, np.asarray(delta_a, float))


def other_actuator(damping: float, ticks: int) -> np.ndarray:
    """Where the second actuator is believed to stand, from 1e-4 on."""
    pilot = Pilot(Bowed(), "force", "previous_step", Limits(FREE, FREE), np.ones(1), RIDGE, damping=np.full(2, damping))
    belief, at = Belief.at(pilot, np.array([2.0, 1e-4])), []
    for _ in range(ticks):
        belief = drive(pilot, belief, GOAL)
        at.append(belief.iterate.condensed.delta_a[1])
    return np.array(at)


@pytest.mark.parametrize("share", [0.0, 1.0, 10.0])
def test_damping_decides_whether_the_published_step_comes_to_rest(share):
    """The step minimises r^2 |d|^2 + s r^2 |d - now|^2 on the tangent, and goes to (s - 2) / (1 + s) of d_2: on the
    tangent d_1 changes by d_2 d(d_2), which the curvature left out would weigh."""
    at = other_actuator(np.sqrt(share) * RIDGE[0], 8)
    np.testing.assert_allclose(at[1:] / at[:-1], (share - CURVATURE * GOAL[0]) / (1 + share), rtol=1e-3)


def test_without_damping_it_jumps_between_two_states_and_with_it_rests():
    jumping, resting = other_actuator(0.0, 400), other_actuator(10 * RIDGE[0], 400)
    assert abs(jumping[-1] - jumping[-2]) > 1 and abs(resting[-1]) < 1e-6


ARM = AnalyticRobot(ARMS["cables"], [20.0, 3000.0, 0.5])
PATH = ARM.length * ARM.arm.effector(np.linspace([0.1, 0.0, 0.1], [0.7, 0.1, 0.5], 20))


def statuses(goals, regularisation=1e-10, command="displacement", **more):
    limits = Limits.of(ARM.reach, ARM.unilateral)
    ridge, settings = ridge_of(regularisation, ARM.reach, ARM.length), SearchSettings.of(ARM.reach, 1)
    pilot = Pilot(ARM, command, "equilibrium", limits, np.ones(3), ridge, settings, **more)
    belief, found = Belief.at(pilot, np.zeros(3)), []
    for goal in goals:
        belief = drive(pilot, belief, goal)
        found.append(belief.status)
    return found


@pytest.mark.parametrize("command", ["displacement", "force"])
def test_a_tick_tells_where_it_is_with_its_goal(command):
    assert statuses(PATH, command=command) == ["tracking"] * len(PATH)
    assert statuses([PATH[-1]] * 30, command=command)[-1] == "converged"
    assert statuses([1.5 * PATH[-1] + [0, 0, 30]] * 60, command=command)[-1] == "out of reach"


def test_what_one_tick_may_change_is_no_bound_of_the_reach():
    found = statuses([PATH[-1]] * 5, rate=1e-9 * stroke(ARM.reach))
    assert found == ["tracking"] * 5


def test_regularisation_that_keeps_a_robot_away_is_trouble():
    assert statuses([PATH[-1]] * 40, regularisation=1e3)[-1] == STOPPED


def test_robots_without_an_object_have_nothing_to_let_go():
    pilot = Pilot(Bowed(), "force", "equilibrium", Limits(FREE, FREE), np.ones(1), RIDGE)
    with pytest.raises(InputError, match="hold no object that they could let go"):
        drive(pilot, Belief.at(pilot, np.zeros(2)), GOAL, let_go=True)
