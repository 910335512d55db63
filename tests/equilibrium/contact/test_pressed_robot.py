"""How a robot under forces on its patches goes on, against solves with other forces."""

from dataclasses import replace

import numpy as np
import pytest
from support.blocks import bar

from cfem.condensed.patches import cut
from cfem.constraint.surface import outer_surface
from cfem.equilibrium.contact.patch_compliance import with_patches
from cfem.equilibrium.contact.pressed_robot import PressedRobot
from cfem.equilibrium.contact.skinned_robot import SkinnedRobot
from cfem.equilibrium.newton import NewtonSettings
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import Actuation, displacement
from cfem.equilibrium.system.evaluation import SolveCost
from cfem.equilibrium.system.problem import Problem

DELTA = np.array([2.0, 3.5])
EXACT = NewtonSettings(tolerance=1e-12)


@pytest.fixture(scope="module", params=[False, True], ids=["plain", "with a contact point that nothing holds"])
def skinned(request):
    robot = bar(divisions=(5, 1, 1), contact=request.param)
    surface = outer_surface(robot.X, robot.body.mesh.facets)
    return SkinnedRobot(
        robot, surface.nodes, surface.triangles, cut(surface.rest, surface.weights, 20.0, surface.triangles)
    )


@pytest.fixture(scope="module")
def chosen(skinned):
    """The two patches farthest from where the bar is held."""
    return np.sort(np.argsort(skinned.patches.rest[:, 0])[-2:])


def with_forces(skinned, chosen, forces, delta=DELTA):
    """The robot with actuators held at delta, under forces on patches."""
    n_a, n = len(delta), len(delta) + forces.size
    asked = Actuation(np.eye(n_a, n), delta, np.append(np.zeros(n_a), forces))
    problem = Problem(with_patches(skinned.robot, skinned.nodes, skinned.patches, chosen))
    found = solve(problem, asked, settings=EXACT, slack=False)
    assert found.converged
    return found


def at_begin(skinned, delta=DELTA):
    return solve(skinned.problem, displacement(DELTA), settings=EXACT, slack=False)


def corrected(robot, forces, most=20):
    """Newton's corrections with the forces given."""
    for count in range(most):
        robot.linear()
        robot.correct((forces - robot.forces).ravel())
        if robot.worn():
            robot.linear()
            robot.correct((forces - robot.forces).ravel())
        if robot.balanced and np.abs(robot.forces - forces).max() < 1e-12:
            return count
        assert robot.advance()
    raise AssertionError("no state")


def test_under_given_forces_corrections_come_to_the_equilibrium(skinned, chosen):
    cost, forces = SolveCost(), np.array([[0.0, 0.3, -0.2], [0.1, 0.0, 0.4]])
    robot = PressedRobot(skinned, 1.1 * DELTA, at_begin(skinned), cost)
    robot.choose(chosen, np.zeros((2, 3)))
    corrected(robot, forces)
    truth = with_forces(skinned, chosen, forces, 1.1 * DELTA)
    assert np.abs(robot.at.x - truth.state.x).max() < 1e-8 and cost.factorizations < 6
    assert np.append(robot.lam, robot.forces) == pytest.approx(truth.state.lam, rel=1e-8)
    alone, change = robot.solved()
    assert alone.converged and alone.lambda_c == pytest.approx(forces.ravel(), abs=1e-8) and change < 1e-8


def test_its_compliance_is_the_slope_of_solves_with_other_forces(skinned, chosen):
    forces = np.array([[0.0, 0.3, -0.2], [0.1, 0.0, 0.4]])
    robot = PressedRobot(skinned, DELTA, at_begin(skinned), SolveCost())
    robot.choose(chosen, np.zeros((2, 3)))
    corrected(robot, forces)
    robot._tangent = None  # of this state itself
    robot._begin = None
    shift, C = robot.linear()
    assert np.abs(shift).max() < 1e-8
    for k, step in enumerate(1e-4 * np.eye(6)):
        ahead, behind = (with_forces(skinned, chosen, forces + s * step.reshape(2, 3)) for s in (1, -1))
        slope = (ahead.delta_c - behind.delta_c) / 2e-4
        np.testing.assert_allclose(C[k], slope, atol=1e-5 * np.abs(C).max())


def test_a_cable_that_pushes_is_let_go_and_none_twice(skinned, chosen):
    pushed = replace(at_begin(skinned), slack=np.array([False, False]))
    pushed.state.lam[0] = -1.0
    robot = PressedRobot(skinned, DELTA, pushed, SolveCost())
    assert robot.change_slack() is True and robot.taut.tolist() == [False, True] and robot.lam[0] == 0.0
    robot.taut[0] = True
    robot.lam[0] = -1.0
    assert robot.change_slack() is None
