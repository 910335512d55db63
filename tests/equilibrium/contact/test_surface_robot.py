"""Bars of finite elements that hold a block by any node of their surface, against an outer search for its pose."""

import numpy as np
import pytest
from support.blocks import bar
from support.held_body import HeldBody, Pose

from cfem.constraint.surface import outer_surface
from cfem.constraint.surface_points import at_nodes
from cfem.contact.law.modes import Mode
from cfem.contact.law.sliding import PARTS, slid_on_object
from cfem.contact.obstacle import Box
from cfem.equilibrium.contact.grasp import FreeObject, grasp_step
from cfem.equilibrium.contact.ground import Pads
from cfem.equilibrium.contact.skinned_robot import SkinnedRobot
from cfem.equilibrium.contact.surface_robot import LEAST, PlacedSurface, chosen, joined
from cfem.equilibrium.system.actuation import displacement
from cfem.plant.grip_plant import GripPlant

PLACE, HALF = np.array([52.5, 5.0, 13.3]), np.array([6.0, 4.5, 3.0])
FLIP = np.diag([1.0, -1.0, -1.0])
PULLS = np.array([0.0, 0.8, 0.8] * 2)
LOAD = np.array([0.0, 1e-2, -1e-2, 0.0, 0.0, 0.0])
MU = 0.9


@pytest.fixture(scope="module")
def skinned():
    """Bars below and above the block, 0.3 mm away from it."""
    robot = bar(element="hex8", divisions=(12, 3, 2), cables=3)
    surface = outer_surface(robot.X, robot.body.mesh.facets)
    points = at_nodes(robot.X, robot.body.mesh.facets, surface)
    poses = (np.eye(3), np.zeros(3)), (FLIP, PLACE - FLIP @ PLACE)
    return [SkinnedRobot(robot, surface.nodes, surface.triangles, points, R, t, itself=False) for R, t in poses]


def grip(skinned):
    held = FreeObject(Box(HALF, t=PLACE), PLACE, LOAD)
    fingers = [PlacedSurface.at_rest(robot) for robot in skinned]
    return GripPlant(fingers, np.array([0, 3, 6]), held, "coulomb", MU, PLACE[None], PULLS)


def test_a_block_rests_where_a_search_for_its_pose_finds_it(skinned):
    """That search meets the block as an obstacle at trial poses, and shares only the finite elements. It leaves 1e-4 of
    the load, and follows friction in 16 parts of a step."""
    body, plant = HeldBody(skinned, Box(HALF), Pose(np.eye(3), PLACE), 4.0, MU), grip(skinned)
    body.go(body.state.pose, np.split(PULLS, 2))
    expected = body.balance(LOAD)
    assert plant.grasp() == "converged" and plant.load == 1.0
    np.testing.assert_allclose(plant.forces(), expected.forces, atol=4e-3 * np.abs(expected.forces).max())
    held = plant.last.around
    np.testing.assert_allclose(PLACE + held.x, expected.pose.t, atol=1e-3)
    np.testing.assert_allclose(held.R, expected.pose.R, atol=5e-4)
    assert plant.forces().sum(axis=0) == pytest.approx(-LOAD[:3], abs=1e-9)
    assert min(len(finger.numbers) for finger in plant.fingers) >= LEAST


def test_whole_steps_that_follow_friction_end_where_short_steps_do(skinned, monkeypatch):
    """Short steps are a sixteenth, and follow friction in one part, as all did before."""

    def place(share, parts):
        monkeypatch.setattr(
            "cfem.equilibrium.contact.posed.slid_on_object", lambda *given: slid_on_object(*given, parts)
        )
        plant = grip(skinned).restarted(share)
        assert plant.grasp() == "converged"
        assert plant.towards(np.array([0.3, 1.0, 0.6, -0.2, 0.9, 1.1])) == "converged"
        return plant.last.around.x

    short = place(1 / 16, 1)
    whole, followed = (np.linalg.norm(place(1.0, parts) - short) for parts in (1, PARTS))
    assert followed < whole / 10 and whole > 1e-3


def test_no_node_is_in_the_block_though_few_are_contact_points(skinned):
    plant = grip(skinned)
    assert plant.grasp() == "converged"
    for finger, state in zip(plant.fingers, plant.solved, strict=True):
        distance = plant.last.around.surface(finger.surface(state))[0]
        assert distance.min() > -1e-4 and len(finger.numbers) < len(distance) / 4


def test_points_that_come_in_join_and_those_of_the_state_before_keep_what_held_them(skinned):
    """A step of the three nodes nearest to the block alone lets others into it."""
    held = FreeObject(Box(HALF, t=PLACE), PLACE, 0 * LOAD, carried=True)
    asked = [displacement(np.array([0.0, 0.8, 0.8]))] * 2
    few = [
        robot.touching(np.sort(np.argsort(held.surface(robot.surface(None))[0])[:LEAST]))
        for robot in grip(skinned).fingers
    ]
    pads = Pads(PLACE + np.array([[0.0, 0.0, 20.0]]), 1.0)
    state = grasp_step([*few, pads], [*asked, displacement(np.zeros(0))], held, "coulomb", MU)
    assert state.converged
    more, before = joined([*few, pads], state, state)
    assert more[2] is pads and all(np.isin(a.numbers, b.numbers).all() for a, b in zip(few, more[:2], strict=True))
    first, there = few[0], np.searchsorted(more[0].numbers, few[0].numbers)
    assert len(more[0].numbers) > len(first.numbers)
    np.testing.assert_array_equal(before.stuck[there], state.stuck[: len(there)])
    assert [before.modes[k] for k in there] == list(state.modes[: len(there)])
    new = np.setdiff1d(np.arange(len(more[0].numbers)), there)
    assert all(before.modes[k] is Mode.OPEN for k in new)
    forces = before.solved[0].lambda_c.reshape(-1, 3)
    assert not forces[new].any()
    np.testing.assert_array_equal(forces[there].ravel(), state.solved[0].lambda_c)
    moved = before.solved[0].delta_c.reshape(-1, 3) + more[0].points
    np.testing.assert_allclose(moved, more[0].surface(state.solved[0])[more[0].numbers], atol=1e-12)
    again, same = chosen(more, before, before.around)
    assert (
        joined(again, same, grasp_step(again, [*asked, displacement(np.zeros(0))], held, "coulomb", MU, same)) is None
    )


def test_robots_close_in_shorter_steps_as_long_as_a_table_bears_the_object(skinned, monkeypatch):
    """Their nodes push it about. Named points do not, and what is in the air is in their hold."""
    plant, went = grip(skinned), []
    plant.table, plant._longest = Pads(PLACE - [0.0, 0.0, 3.0] + np.zeros((1, 3)), 0.01), 0.4

    def go(self, u, load):
        went.append(u)
        self.at, self.last = u, "known"
        return "converged"

    monkeypatch.setattr(GripPlant, "_go", go)
    for last, borne, steps in ((None, 1.0, 16), ("known", 1.0, 16), ("known", 0.0, 2)):
        monkeypatch.setattr(GripPlant, "on_table", lambda self, borne=borne: borne)
        plant.reset()
        plant.last = last
        went.clear()
        assert plant.towards(PULLS) == "converged" and len(went) == steps
    monkeypatch.setattr(GripPlant, "_at_surface", False)
    plant.reset()
    went.clear()
    assert plant.towards(PULLS) == "converged" and len(went) == 2
