"""Two bars that squeeze a block between them: it is carried, slides and is let go."""

from dataclasses import replace

import numpy as np
import pytest
from support.blocks import bar
from support.obstacle_step import obstacle_step

from cfem.contact.law.modes import Mode
from cfem.contact.obstacle import Box, Plane
from cfem.contact.step_status import StepStatus
from cfem.equilibrium.contact.grasp import FreeObject, grasp_step
from cfem.equilibrium.contact.ground import Pads
from cfem.equilibrium.contact.points import PlacedRobot
from cfem.equilibrium.system.actuation import displacement, force
from cfem.equilibrium.system.problem import Problem

REST = np.array([30.0, 5.0, 9.0])  # of a bar's contact point, which its cables lift
FLIP = np.diag([1.0, -1.0, -1.0])
HALF = np.array([4.0, 4.0, 3.0])
CENTRE = REST + [0, 0, 3.0]


@pytest.fixture(scope="module")
def fingers():
    """The second one upside down above the first, the block touching both."""
    problem = Problem(bar(element="hex8", cables=2, contact=True))
    return [PlacedRobot(problem, np.eye(3), np.zeros(3)), PlacedRobot(problem, FLIP, CENTRE - FLIP @ CENTRE)]


def lift(share):
    return displacement(np.array([-share, share]))


def block(load=(0.0, 0.0, 0.0), turns=False):
    return FreeObject(Box(HALF, t=CENTRE), CENTRE, np.array([*load, 0, 0, 0.0]), turns)


def test_the_second_finger_touches_the_block_from_above(fingers):
    np.testing.assert_allclose(fingers[1].points[0], REST + [0, 0, 6.0], atol=1e-12)


def test_equal_fingers_leave_the_block_at_its_height_as_two_walls_would(fingers):
    """By symmetry the block keeps its height and follows the points along the bars, so that each finger presses as
    against a wall at the block's face that lets it slide along the bar."""
    found = grasp_step(fingers, [lift(0.5), lift(0.5)], block(), mu=0.5)
    assert found.converged and found.check.largest <= 1e-8
    np.testing.assert_allclose(found.around.x[2], 0.0, atol=1e-9)
    push, slides = found.solved[0].lambda_c, found.around.x * [1, 0, 0]
    assert abs(push[0]) < 1e-8 * abs(push[2])
    wall = obstacle_step(fingers[0].problem, lift(0.5), [Plane(R=FLIP, t=REST)], mu=10.0)
    wall = obstacle_step(
        fingers[0].problem, lift(0.5), [Plane(R=FLIP, t=REST)], mu=10.0, before=wall, carried=REST + slides[None]
    )
    np.testing.assert_allclose(push, wall.solved[0].lambda_c, atol=1e-7 * abs(push[2]))


def test_friction_carries_the_block_and_the_block_balances(fingers):
    squeezed = grasp_step(fingers, [lift(0.5), lift(0.5)], block(), mu=0.5)
    moved = grasp_step(fingers, [lift(0.6), lift(0.4)], block(), mu=0.5, before=squeezed)
    assert moved.converged and moved.around.x[2] > 1e-3
    sum_of_forces = sum(
        finger.turn @ one.lambda_c.reshape(-1, 3).sum(axis=0) for finger, one in zip(fingers, moved.solved, strict=True)
    )
    np.testing.assert_allclose(sum_of_forces, 0.0, atol=1e-9 * np.abs(moved.solved[0].lambda_c).max())


def test_a_sideways_load_beyond_friction_has_no_equilibrium_and_below_it_sticks(fingers):
    squeezed = grasp_step(fingers, [lift(0.5), lift(0.5)], block(), mu=1.0)
    normal = -squeezed.solved[0].lambda_c[2]

    def pulled(share):
        load = block(load=(2 * normal * share, 0, 0))
        return grasp_step(fingers, [lift(0.5), lift(0.5)], load, mu=1.0, before=squeezed)

    little = pulled(0.2)
    assert little.converged and little.modes == (Mode.STICK, Mode.STICK) and little.around.x[0] > squeezed.around.x[0]
    much = pulled(2.0)
    assert not much.converged and much.status in (StepStatus.NO_MODE, StepStatus.ITERATIONS)


def test_a_block_rests_on_the_lower_finger_and_nothing_holds_it_sideways_in_the_air(fingers):
    found = grasp_step(fingers, [force(np.zeros(2))] * 2, block(load=(0, 0, -1e-3)), "signorini")
    assert found.converged and found.modes == (Mode.SLIP, Mode.OPEN) and found.around.x[2] < 0
    np.testing.assert_allclose(found.solved[0].lambda_c, [0, 0, -1e-3], atol=1e-11)
    away = grasp_step(fingers, [lift(-0.5), lift(-0.5)], block(load=(0, 1e-3, 0)), mu=0.5)
    assert away.status is StepStatus.NO_MODE


@pytest.mark.parametrize("turns", [False, True])
def test_a_block_that_turns_balances_its_moments(fingers, turns):
    """A load off the middle: with friction at two points that face each other nothing else than tilting gives way."""
    squeezed = grasp_step(fingers, [lift(0.5), lift(0.5)], block(turns=turns), mu=1.0)
    found = grasp_step(fingers, [lift(0.55), lift(0.5)], block(load=(1e-3, 0, 0), turns=turns), mu=1.0, before=squeezed)
    if turns:
        assert found.converged
        arms = [REST + found.solved[0].delta_c - CENTRE - found.around.x]
        arms.append(fingers[1].points[0] + FLIP @ found.solved[1].delta_c - CENTRE - found.around.x)
        pushes = [-found.solved[0].lambda_c, -FLIP @ found.solved[1].lambda_c]
        np.testing.assert_allclose(sum(pushes) + [1e-3, 0, 0], 0.0, atol=1e-9)
        np.testing.assert_allclose(np.cross(arms, pushes).sum(axis=0), 0.0, atol=1e-8)
        np.testing.assert_allclose(found.around.R @ found.around.R.T, np.eye(3), atol=1e-12)
    else:
        assert found.converged and np.array_equal(found.around.R, np.eye(3))


def test_the_way_to_a_pose_is_the_motion_that_leads_there():
    xi = np.array([0.3, -0.2, 0.1, 0.05, -0.2, 0.4])
    begin = block(turns=True).moved(np.array([1.0, 2.0, 3.0, 0.3, 0.1, -0.2]))
    np.testing.assert_allclose(begin.way_to(begin.moved(xi)), xi, atol=1e-12)
    guided = block()
    np.testing.assert_allclose(guided.way_to(guided.moved(xi[:3])), xi[:3], atol=1e-12)
    assert not len(replace(guided, carried=True).way_to(guided))


@pytest.mark.parametrize("mobility", [0.5, 50.0])
def test_a_block_that_nothing_holds_sinks_by_its_drag_until_its_table_bears_it(mobility):
    """One step: (load - 4 force) mobility, and 1 mm above the table no force; closed form."""
    weight, gap, soft = 0.1, 1.0, 0.01
    corners = CENTRE + np.array([[x, y, -3.0 - gap] for x in (-3, 3) for y in (-3, 3)])
    held = replace(block((0, 0, -weight), turns=True), mobility=np.array([mobility] * 3 + [mobility / 20] * 3))
    found = grasp_step([Pads(corners, soft)], [displacement(np.zeros(0))], held, "coulomb", 0.5)
    assert found.converged
    free = mobility * weight
    force = max(0.0, (free - gap) / (4 * mobility + soft))  # gap = free - 4 force mobility - soft force
    np.testing.assert_allclose(found.around.x, [0, 0, -(free - 4 * mobility * force)], atol=1e-9)
    np.testing.assert_allclose(found.around.R, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(found.posed.force[::3], force, atol=1e-9)
