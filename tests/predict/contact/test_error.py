"""What the error of a contact state is in proportion to, against contact states of obstacles that stand elsewhere."""

from dataclasses import replace

import numpy as np
import pytest

from cfem.condensed.model_error import ContactError, ContactFactors
from cfem.contact.obstacle import Sphere
from cfem.contact.step_status import StepStatus
from cfem.predict.contact import error
from cfem.predict.contact.error import BENT, FLOOR, contact_error, expected_error, forces_of, touching
from cfem.predict.contact.step.scene import contact_step
from cfem.predict.contact.step.state import TRUSTED

RADIUS, APART, SHALLOW = 4.0, 1e-4, 0.01  # mm
SIDES = (0.55, 1), (0.95, -1)  # of the length: one above, one below


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


def test_a_misplaced_surface_changes_forces_and_tip_as_misplaced_obstacles_do(patched_bar, delta, pressed, monkeypatch):
    """Obstacles hardly press, so that the compliance is that without forces."""
    monkeypatch.setattr(error, "FLOOR", 0.0)
    state = contact_step(patched_bar, delta, pressed(SHALLOW, SHALLOW))
    assert touching(state) == [1, 2]
    forces, tip = np.zeros(2), 0.0
    for depths in ((SHALLOW + APART, SHALLOW), (SHALLOW, SHALLOW + APART)):
        other = contact_step(patched_bar, delta, pressed(*depths), before=state)
        forces += np.linalg.norm(forces_of(other, [1, 2]) - forces_of(state, [1, 2]), axis=1)
        tip += np.linalg.norm(other.delta_e[0] - state.delta_e[0])
    expected = expected_error(np.full(len(patched_bar.patches), APART), patched_bar, state)
    assert expected == pytest.approx((forces.max(), tip), rel=0.02)


def test_the_share_of_one_obstacle_grows_with_its_way(patched_bar, delta, spheres):
    """The way from the energy that the state says is stored."""
    state = contact_step(patched_bar, delta, spheres[1:])
    assert len(state.pairs) == 1
    force = np.linalg.norm(state.forces.sum(axis=0))
    way = 2 * state.stored / force
    nothing = np.zeros(len(patched_bar.patches))
    share = expected_error(nothing, patched_bar, state)[0] / force
    assert share == pytest.approx(FLOOR * (1 + way / (BENT * patched_bar.model.length)), rel=0.05)


def test_obstacles_on_both_sides_make_more_of_what_is_not_known(patched_bar, delta, spheres, state):
    nothing = np.zeros(len(patched_bar.patches))

    def share(state):
        return expected_error(nothing, patched_bar, state)[0] / np.linalg.norm(state.forces, axis=1).sum()

    assert share(state) > 2 * max(share(contact_step(patched_bar, delta, [sphere])) for sphere in spheres)


def test_nothing_is_promised_of_states_that_are_not_trusted_or_that_more_touches(patched_bar, delta, state):
    one, several = (ContactFactors(probability=0.95, places=20, force=2.0, tip=size) for size in (3.0, 4.0))
    given = {"probability": 0.95, "left_out": 0, "friction": 0.0, "off": [1e-3] * len(patched_bar.patches)}
    stated = ContactError(one=one, several=several, most=2, **given)
    force, tip = expected_error(np.array(stated.off), patched_bar, state)
    bounds = contact_error(stated, patched_bar, state)
    assert (bounds.force, bounds.tip) == pytest.approx((2 * force, 4 * tip))
    for changes in ({"error": 1.01 * TRUSTED}, {"deep": True}, {"status": StepStatus.ITERATIONS}):
        bounds = contact_error(stated, patched_bar, replace(state, **changes))
        assert bounds.force == bounds.tip == np.inf
    for changes in ({"most": 1}, {"several": None}):
        assert contact_error(stated.model_copy(update=changes), patched_bar, state).force == np.inf
    away = contact_step(patched_bar, delta, [Sphere(RADIUS, t=np.array([0.0, 0.0, 500.0]))])
    assert contact_error(stated, patched_bar, away).force == 0.0
