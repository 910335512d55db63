"""What a contact state says of itself."""

from dataclasses import replace

import numpy as np
import pytest

from cfem.contact.obstacle import Plane, Sphere
from cfem.contact.obstacle_set import ObstacleSet
from cfem.contact.pairs import Pairs
from cfem.equilibrium.contact.skinned_robot import SkinnedRobot
from cfem.equilibrium.contact.surfaces import SurfaceScene
from cfem.predict.contact.error import forces_of
from cfem.predict.contact.step.bodies import PlacedModel
from cfem.predict.contact.step.rounds import Rounds
from cfem.predict.contact.step.scene import ContactScene, contact_step
from cfem.predict.contact.step.state import GOES_ON, SETTLED, TRUSTED

DELTA = np.array([7.436])
RADIUS = 4.0
FROM_ABOVE, FROM_BELOW = (
    direction / np.linalg.norm(direction) for direction in np.array([[-0.57, 0.65, 0.5], [0.51, -0.67, -0.54]])
)
SPHERE, PLANE = (np.array(point) for point in ([29.76, 5.73, 19.61], [33.55, -3.69, 8.35]))  # mm
DEPTHS = 0.632, 0.322  # mm


def between(share):
    """A sphere and a plane on opposite sides of the bar, which have come so much of their depths into it."""
    away = [(1 - share) * depth * normal for depth, normal in zip(DEPTHS, (FROM_ABOVE, FROM_BELOW), strict=True)]
    across = np.cross(FROM_BELOW, [1.0, 0, 0])
    across /= np.linalg.norm(across)
    R = np.stack([np.cross(across, -FROM_BELOW), across, -FROM_BELOW], axis=1)
    return ObstacleSet((Sphere(RADIUS, t=SPHERE + away[0]), Plane(R=R, t=PLANE + away[1])))


def test_forces_that_hardly_settle_between_obstacles_are_wrong_and_not_trusted(patched_bar, robot):
    """Steps are short, no patch is deep, and forces bend the bar little."""
    skin = patched_bar.model.skin
    skinned = SkinnedRobot(robot, skin.nodes, skin.triangles, patched_bar.patches, itself=False)
    learned = full = None
    says = []
    for share in (0.05, 0.275, 0.5, 0.75, 1.0):
        learned = contact_step(patched_bar, DELTA, between(share), before=learned, unilateral=robot.unilateral)
        full = SurfaceScene([skinned], between(share), 0.0).step([DELTA], full)
        assert learned.converged and full.converged and learned.error < TRUSTED and not learned.deep
        apart, truth = forces_of(learned, [1, 2]) - forces_of(full, [1, 2]), forces_of(full, [1, 2])
        off = np.linalg.norm(apart, axis=1).max() / np.linalg.norm(truth, axis=1).sum()
        says.append((learned.trusted, off))
    assert [trusted for trusted, _ in says] == [True, False, False, False, False]
    assert says[-1][1] > 0.05


def test_a_state_is_trusted_where_nothing_speaks_against_it(patched_bar):
    state = contact_step(patched_bar, DELTA, between(0.05))
    assert state.trusted
    for changes in ({"error": 1.01 * TRUSTED}, {"deep": True}, {"unsettled": True}):
        assert not replace(state, **changes).trusted


def test_what_has_not_settled_stays_so_until_nothing_is_near(patched_bar):
    """Asked again, a state takes a round or two, on whichever branch it is."""
    state = contact_step(patched_bar, DELTA, between(0.05))
    for share in (0.275, 0.275):
        state = contact_step(patched_bar, DELTA, between(share), before=state)
        assert state.unsettled
    assert state.iterations <= SETTLED
    free = contact_step(patched_bar, DELTA, (), before=state)
    assert not contact_step(patched_bar, DELTA, between(0.05), before=free).unsettled


def test_forces_go_on_where_all_that_touches_sticks_and_none_changes_much(patched_bar):
    state = contact_step(patched_bar, DELTA, between(0.05))
    assert np.array_equal(state.change, state.forces) and not state.steady  # it has begun to touch
    sticks = np.ones(len(state.forces), dtype=bool)
    state = replace(state, sticks=sticks, change=0.99 * GOES_ON * state.forces)
    assert state.steady and np.array_equal(state.going_on(), state.forces + state.change)
    assert not replace(state, change=1.01 * GOES_ON * state.forces).steady
    slides = np.arange(len(sticks)) == state.pairs.points[0]
    assert not replace(state, sticks=~slides).steady
    left = replace(state, forces=np.zeros_like(state.forces), change=-state.forces, pairs=Pairs.none(len(sticks)))
    assert not left.steady  # it has come off


@pytest.mark.parametrize("left", [0, 1])
def test_patches_of_obstacles_that_are_gone_are_not_near_any(patched_bar, left):
    """No frame is asked of an obstacle that is not there."""
    obstacles = between(0.05).obstacles
    state = contact_step(patched_bar, DELTA, obstacles)
    assert set(state.met.tolist()) == {0, 1}
    scene = ContactScene([PlacedModel(patched_bar, itself=False)], ObstacleSet(obstacles[:left]), 0.0)
    began = Rounds(scene, [DELTA], state).met
    assert len(began.near) == np.sum(state.met < left) and not np.delete(began.push, began.near, axis=0).any()
    after = scene.step([DELTA], state)
    assert after.converged and (after.met < left).all() and np.isfinite(after.places).all()
