"""The error that a touched model states, at places of finite elements that it was not calibrated with."""

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from cfem.condensed.model_error import ContactError
from cfem.contact.step_status import StepStatus
from cfem.core.errors import NumericalError
from cfem.predict.contact.error import FLOOR, contact_error, measure, sizes, touching
from cfem.predict.contact.step.state import TRUSTED
from cfem.surrogate import contact_error as calibration
from cfem.surrogate.contact_error import calibrated_contact, error_at, pressed_places


@pytest.fixture(scope="module")
def places(patched_bar, robot):
    """Of one, two and three obstacles."""
    return list(islice(pressed_places(patched_bar, robot, seed=3), 12))


@pytest.fixture(scope="module")
def known(places):
    return [place for place in places if place.known]


@pytest.fixture(scope="module")
def stated(patched_bar, known):
    return error_at(patched_bar, known[::2], 0, 0.0)


def test_errors_are_those_of_the_forces_and_of_how_they_move_the_tip(patched_bar, known):
    place = next(place for place in known if len(place.kinds) == 1)
    (solved,) = place.full.solved
    force, tip = place.errors(patched_bar)
    own = place.learned.forces.sum(axis=0)
    assert np.linalg.norm(own - place.full.forces.sum(axis=0)) == pytest.approx(force * np.linalg.norm(own), rel=1e-9)
    free = patched_bar.model.at_displacement(place.learned.deltas[0]).delta_e
    apart = np.linalg.norm((place.learned.delta_e[0] - free) - (solved.delta_e - place.free))
    assert apart == pytest.approx(tip * np.linalg.norm(place.learned.delta_e[0] - free), rel=1e-4)


def test_several_obstacles_come_at_once_and_each_has_its_error(patched_bar, known):
    place = max(known, key=lambda place: len(touching(place.learned)))
    state, met = place.learned, touching(place.learned)
    assert len(met) >= 2 and touching(place.full) == met
    force, moved = sizes(patched_bar, state)
    assert force >= np.linalg.norm(state.forces.sum(axis=0)) * (1 - 1e-12)  # forces that oppose each other count
    assert moved >= np.linalg.norm(state.moved[0]) * (1 - 1e-12)
    mine = [state.push[state.among(0, number)].sum(axis=0) for number in met]
    theirs = [place.full.push[place.full.among(0, number)].sum(axis=0) for number in met]
    worst = np.linalg.norm(np.subtract(mine, theirs), axis=1).max()
    assert worst == pytest.approx(place.errors(patched_bar)[0] * np.linalg.norm(mine, axis=1).sum(), rel=1e-9)


def test_the_measure_is_the_error_of_the_place_over_the_way_that_forces_push(patched_bar, known):
    """The way from the places of the learned surface itself, and the energy that the state says is stored."""
    place = next(place for place in known if len(place.kinds) == 1)
    state, N = place.learned, len(patched_bar.patches)
    free = patched_bar.patches.mean(patched_bar.model.shape(state.deltas[0]))
    way = (state.forces * (state.places - free)).sum() / np.linalg.norm(state.forces.sum(axis=0))
    assert measure(np.zeros(N), state) == 1.0
    assert measure(np.full(N, 0.01), state) == pytest.approx(1 + 0.01 / way / FLOOR, rel=0.05)


def test_bounds_hold_at_other_places(stated, patched_bar, known):
    """A few places promise a few of one more."""
    assert stated.probability == pytest.approx(stated.places / (stated.places + 1))
    assert stated.most == max(len(place.kinds) for place in known[::2])
    others, within = known[1::2], 0
    assert len(others) >= 3
    for place in others:
        bounds, size = contact_error(stated, patched_bar, place.learned), sizes(patched_bar, place.learned)
        true = np.array(place.errors(patched_bar)) * size
        within += bool(true[0] <= bounds.force and true[1] <= bounds.tip)
        assert bounds.force < size[0] and bounds.tip < size[1]
    assert within >= len(others) - 1
    assert ContactError.model_validate_json(stated.model_dump_json()) == stated


def test_nothing_is_promised_of_states_that_are_not_trusted_or_that_more_touches(stated, patched_bar, known):
    state = known[0].learned
    for changes in ({"error": 1.01 * TRUSTED}, {"deep": True}, {"status": StepStatus.ITERATIONS}):
        bounds = contact_error(stated, patched_bar, replace(state, **changes))
        assert bounds.force == bounds.tip == np.inf
    several = max(known, key=lambda place: len(touching(place.learned))).learned
    assert contact_error(stated.model_copy(update={"most": 1}), patched_bar, several).force == np.inf


def test_what_is_not_trusted_is_left_out(patched_bar, robot, places, known, monkeypatch):
    monkeypatch.setattr(calibration, "pressed_places", lambda *_: iter(places))
    stated = calibrated_contact(patched_bar, robot, len(places))
    assert (stated.places, stated.left_out) == (len(known), len(places) - len(known))
    deep = [replace(place, learned=replace(place.learned, deep=True)) for place in places]
    monkeypatch.setattr(calibration, "pressed_places", lambda *_: iter(deep))
    with pytest.raises(NumericalError, match="0 of 3 contact places"):
        calibrated_contact(patched_bar, robot, 3)
