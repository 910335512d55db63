"""What pressing and gripping share: robots that are placed, and what they meet."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.blocks import bar
from support.obstacle_step import Obstacles

from cfem.contact.law.modes import Mode
from cfem.contact.obstacle import Box, Plane
from cfem.contact.step_status import StepStatus
from cfem.equilibrium.contact.grasp import FreeObject
from cfem.equilibrium.contact.points import PlacedRobot, points_step
from cfem.equilibrium.system.actuation import displacement
from cfem.equilibrium.system.evaluation import SolveCost
from cfem.equilibrium.system.problem import Problem

REST = np.array([30.0, 5.0, 9.0])  # of the bar's contact point
LIFT = displacement(np.array([-1.0, 1.0]))
CEILING = Plane(R=np.diag([1.0, -1.0, -1.0]), t=REST + [0, 0, 0.3])


@pytest.fixture(scope="module")
def problem():
    return Problem(bar(element="tet4", cables=2, contact=True))


def test_turning_and_moving_robot_and_obstacle_turns_and_moves_the_answer(problem):
    R, shift = Rotation.from_rotvec([0.3, -0.8, 0.5]).as_matrix(), np.array([12.0, -7.0, 3.0])
    placed = Obstacles((replace(CEILING, R=R @ CEILING.R, t=R @ CEILING.t + shift),))
    there = points_step([PlacedRobot(problem, R, shift)], [LIFT], placed, mu=0.3)
    here = points_step([PlacedRobot(problem, np.eye(3), np.zeros(3))], [LIFT], Obstacles((CEILING,)), mu=0.3)
    assert there.converged and there.modes == here.modes
    np.testing.assert_allclose(there.solved[0].lambda_c, here.solved[0].lambda_c, rtol=1e-6)
    np.testing.assert_allclose(there.stuck, here.stuck @ R.T + shift, atol=1e-7)


def test_the_rounds_allowed_are_counted_and_said(problem):
    found = points_step(
        [PlacedRobot(problem, np.eye(3), np.zeros(3))], [LIFT], Obstacles((CEILING,)), mu=0.3, iterations=1
    )
    assert found.status is StepStatus.ITERATIONS and found.iterations == 1 and not found.converged
    longer = points_step([PlacedRobot(problem, np.eye(3), np.zeros(3))], [LIFT], Obstacles((CEILING,)), mu=0.3)
    assert longer.converged and longer.iterations > 1 and longer.factorizations > found.factorizations
    assert longer.modes[0] is not Mode.OPEN and longer.check.largest <= 1e-8


def test_a_robot_with_a_problem_of_its_own_goes_on_with_the_factor_of_the_last_step(problem):
    """And comes to the state of one that has to factorise at every round: another robot has used its factorisation."""

    def go(robot, disturb):
        found, cost = None, 0
        for share in (0.8, 0.9, 1.0):
            if disturb:
                robot.problem.factor(robot.problem.evaluate(problem.rest, np.empty(0)), np.zeros(5), SolveCost())
            asked = displacement(share * LIFT.target)
            found = points_step([robot], [asked], Obstacles((CEILING,)), before=found, mu=0.3)
            assert found.converged and found.check.largest <= 1e-9
            cost += found.factorizations
        return found, cost

    (own, few), (disturbed, more) = (
        go(PlacedRobot(Problem(problem.robot), np.eye(3), np.zeros(3)), one) for one in (False, True)
    )
    assert few < more
    np.testing.assert_allclose(own.solved[0].lambda_c, disturbed.solved[0].lambda_c, rtol=1e-7)
    np.testing.assert_allclose(own.solved[0].state.x, disturbed.solved[0].state.x, atol=1e-7)


def test_places_of_an_object_go_with_it():
    free = FreeObject(Box(np.array([4.0, 3.0, 2.0]), t=REST), REST + [1.0, 0, 0], np.arange(6.0))
    moved = free.moved(np.array([0.1, 0.2, 0.3, 0.4, -0.2, 0.1])).moved(np.array([0.0, 0, 0, 0, 0, 0.3]))
    at = REST + np.array([[0.0, 3.0, 0.5], [4.0, -1.0, 0.0]])
    np.testing.assert_allclose(moved.places(moved.now(at)), at, atol=1e-12)
    np.testing.assert_allclose(moved.surface(moved.now(at))[0], free.surface(at)[0], atol=1e-12)
    assert np.array_equal(moved.wrench, np.arange(6.0))
    assert np.array_equal(replace(moved, turns=False).wrench, np.arange(3.0))


@pytest.mark.parametrize("turns", [False, True])
def test_motion_is_the_derivative_of_where_places_are(turns):
    free = FreeObject(Box(np.ones(3), t=REST), REST, np.zeros(6), turns).moved(np.array([0.1, 0.0, 0.2, 0.3, 0.2, 0.1]))
    at, n, h = REST + np.array([[0.0, 3.0, 0.5], [4.0, -1.0, 0.0]]), 6 if turns else 3, 1e-6
    slopes = [(free.moved(h * e).now(at) - free.moved(-h * e).now(at)).ravel() / (2 * h) for e in np.eye(n)]
    np.testing.assert_allclose(free.motion(free.now(at)), np.column_stack(slopes), atol=1e-8)
