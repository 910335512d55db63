"""What the error of a contact state is in proportion to, against contact states of obstacles that stand elsewhere."""

from dataclasses import replace

import numpy as np
import pytest

from cfem.condensed.model_error import ContactError, ContactFactors
from cfem.contact.obstacle import Sphere
from cfem.contact.pairs import Pairs
from cfem.contact.step_status import StepStatus
from cfem.predict.contact import error
from cfem.predict.contact.error import (
    BENT,
    FLOOR,
    NOT_STATED,
    ContactBounds,
    contact_error,
    expected_error,
    forces_of,
    touching,
    unevenness,
)
from cfem.predict.contact.step.bodies import Bodies, PlacedModel
from cfem.predict.contact.step.scene import ContactScene, contact_step
from cfem.predict.contact.step.state import TRUSTED

RADIUS, APART, SHALLOW = 4.0, 1e-4, 0.01  # mm
SIDES = (0.55, 1), (0.95, -1)  # of the length: one above, one below


@pytest.fixture(scope="module")
def alone(patched_bar):
    return Bodies([PlacedModel(patched_bar, itself=False)])


@pytest.fixture(scope="module")
def delta(patched_bar):
    return np.array([0.3 * np.max(patched_bar.model.reach)])


@pytest.fixture(scope="module")
def pressed(patched_bar, delta):
    """Spheres that come so deep in from both sides."""
    at = patched_bar.patches.mean(patched_bar.model.shape(delta))
    along, up = at[:, 0] / at[:, 0].max(), at[:, 2] / np.abs(at[:, 2]).max()
    places = [(at[np.argmin(np.abs(along - share) - side * up)], side) for share, side in SIDES]

    def pressed(*depths):
        each = zip(places, depths, strict=True)
        return [Sphere(RADIUS, t=at + side * np.array([0.0, 0.0, RADIUS - depth])) for (at, side), depth in each]

    return pressed


@pytest.fixture(scope="module")
def spheres(pressed):
    return pressed(0.05, 0.1)


@pytest.fixture(scope="module")
def state(patched_bar, delta, spheres):
    state = contact_step(patched_bar, delta, spheres)
    assert state.trusted and touching(state) == [1, 2]
    return state


def test_a_misplaced_surface_changes_forces_and_tip_as_misplaced_obstacles_do(
    patched_bar, alone, delta, pressed, monkeypatch
):
    """Obstacles hardly press, so that the compliance is that without forces."""
    monkeypatch.setattr(error, "FLOOR", 0.0)
    state = contact_step(patched_bar, delta, pressed(SHALLOW, SHALLOW))
    assert touching(state) == [1, 2]
    forces, tip = np.zeros(2), 0.0
    for depths in ((SHALLOW + APART, SHALLOW), (SHALLOW, SHALLOW + APART)):
        other = contact_step(patched_bar, delta, pressed(*depths), before=state)
        forces += np.linalg.norm(forces_of(other, [1, 2]) - forces_of(state, [1, 2]), axis=1)
        tip += np.linalg.norm(other.delta_e[0] - state.delta_e[0])
    expected = expected_error(np.full(len(patched_bar.patches), APART), alone, state)
    assert expected == pytest.approx((forces.max(), tip), rel=0.02)


def test_the_share_of_one_obstacle_grows_with_its_way(patched_bar, alone, delta, spheres):
    """The way from the energy that the state says is stored."""
    state = contact_step(patched_bar, delta, spheres[1:])
    assert len(state.pairs) == 1
    force = np.linalg.norm(state.forces.sum(axis=0))
    way = 2 * state.stored / force
    nothing = np.zeros(len(patched_bar.patches))
    share = expected_error(nothing, alone, state)[0] / force
    assert share == pytest.approx(FLOOR * (1 + way / (BENT * patched_bar.model.length)), rel=0.05)


def test_obstacles_on_both_sides_make_more_of_what_is_not_known(patched_bar, alone, delta, spheres, state):
    nothing = np.zeros(len(patched_bar.patches))

    def share(state):
        return expected_error(nothing, alone, state)[0] / np.linalg.norm(state.forces, axis=1).sum()

    assert share(state) > 2 * max(share(contact_step(patched_bar, delta, [sphere])) for sphere in spheres)


def test_nothing_is_promised_of_states_that_are_not_trusted_or_that_more_touches(patched_bar, alone, delta, state):
    one, several = (ContactFactors(probability=0.95, places=20, force=2.0, tip=size) for size in (3.0, 4.0))
    given = {"probability": 0.95, "left_out": 0, "friction": 0.0, "points": 9, "off": [1e-3] * len(patched_bar.patches)}
    stated = ContactError(one=one, several=several, most=2, **given)
    force, tip = expected_error(np.array(stated.off), Bodies([PlacedModel(patched_bar)]), state)
    bounds = contact_error([stated], alone, state)
    assert (bounds.force, bounds.tip) == pytest.approx((2 * force, 4 * tip))
    for changes in ({"error": 1.01 * TRUSTED}, {"deep": True}, {"status": StepStatus.ITERATIONS}):
        bounds = contact_error([stated], alone, replace(state, **changes))
        assert bounds.force == bounds.tip == np.inf
    for changes in ({"most": 1}, {"several": None}):
        assert contact_error([stated.model_copy(update=changes)], alone, state).force == np.inf
    away = contact_step(patched_bar, delta, [Sphere(RADIUS, t=np.array([0.0, 0.0, 500.0]))])
    assert contact_error([stated], alone, away).force == 0.0


HERE, OVER = (np.eye(3), np.zeros(3)), (np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 16.0]))  # upside down, above
MEET = [np.array([1.01]), np.array([0.93])]  # mm: cables of both


def twins(patched_bar, moved=(0.0, 0.0, 0.0)):
    R, t = OVER
    return ContactScene([PlacedModel(patched_bar, *HERE, False), PlacedModel(patched_bar, R, t + moved, False)])


@pytest.fixture(scope="module")
def meeting(patched_bar):
    """Scene of two bars that hardly press each other, and their state."""
    scene = twins(patched_bar)
    state = scene.go(MEET)
    assert state.trusted and touching(state) == [1] and 0 < state.between(0, 1) < 0.02
    return scene, state


def test_a_misplaced_soft_surface_changes_forces_and_tip_as_a_displaced_robot_does(patched_bar, meeting, monkeypatch):
    """Of one pair: its node is off, or the points that it presses, by their shares."""
    monkeypatch.setattr(error, "FLOOR", 0.0)
    scene, state = meeting
    (pressed,), off = np.flatnonzero(state.push.any(axis=1)), np.zeros(len(state.places))
    nearer = APART * state.push[pressed] / np.linalg.norm(state.push[pressed])
    nearer *= 1 if state.bodies[state.pairs.points[pressed]] == 0 else -1
    other = twins(patched_bar, nearer).step(MEET, state)
    force = abs(other.between(0, 1) - state.between(0, 1))
    tip = np.linalg.norm(other.delta_e[0] - state.delta_e[0])
    point, weights = state.pairs.points[pressed], state.pairs.relative[pressed]
    off[point] = APART
    assert expected_error(off, scene, state) == pytest.approx((force, tip), rel=0.01)
    shares = np.delete(np.abs(weights), point).sum()
    by_faces = expected_error(APART - off, scene, state)
    assert by_faces == pytest.approx((shares * force, shares * tip), rel=0.01) and shares > 0.99


def test_the_force_of_a_soft_obstacle_is_the_sum_of_its_normal_forces(meeting):
    """On either side, as control states it."""
    state = meeting[1]
    assert forces_of(state, [1]) == pytest.approx(np.array([[state.between(0, 1), 0.0, 0.0]]))


def test_soft_obstacles_that_press_at_edges_or_by_more_points_are_not_stated(meeting, monkeypatch):
    scene, state = meeting
    factors = ContactFactors(probability=0.95, places=20, force=2.0, tip=3.0)
    given = {"probability": 0.95, "left_out": 0, "friction": 0.0, "off": [1e-3] * scene.ends[1], "several": None}
    mine, other = (
        ContactError(one=factors.model_copy(update={"force": force}), most=1, points=1, **given) for force in (2.0, 4.0)
    )
    force, tip = expected_error(np.full(len(state.places), 1e-3), scene, state)
    assert contact_error([mine, other], scene, state) == ContactBounds(pytest.approx(4 * force), pytest.approx(3 * tip))
    few = other.model_copy(update={"points": 0})
    assert contact_error([mine, few], scene, state) == NOT_STATED
    monkeypatch.setattr(error, "FLAT", 0.0)
    assert contact_error([mine, other], scene, state) == NOT_STATED


def test_points_over_an_edge_are_uneven():
    """A node 1 mm above a roof whose two sides fall by 0.3 mm over 1 mm, its points 2 mm apart."""
    places = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, -0.3], [0.0, 0.0, 0.0], [1.0, 0.0, -0.3]])
    relative, frames = np.array([[1.0, -0.25, -0.5, -0.25]]), np.eye(3)[None, [2, 0, 1]]
    pairs = Pairs(np.array([0]), relative, frames, np.array([1.15]), np.array([1]))
    roof = unevenness(pairs, places, np.full(4, 2.0))
    assert roof == pytest.approx([0.15 / 2])
    flat = places * [1.0, 1.0, 0.0] + [[0.0, 0.0, 1.0], *np.zeros((3, 3))]
    assert unevenness(pairs, flat, np.full(4, 2.0)) == pytest.approx([0.0])
