"""The error that a touched model states, at places of finite elements that it was not calibrated with."""

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from cfem.contact.step_status import StepStatus
from cfem.core.errors import NumericalError
from cfem.predict.contact.error import LEAST, ContactError, bending, contact_error, sizes
from cfem.predict.contact.state import TRUSTED
from cfem.surrogate import contact_error as calibration
from cfem.surrogate.contact_error import calibrated_contact, pressed_places


@pytest.fixture(scope="module")
def places(patched_bar, robot):
    return list(islice(pressed_places(patched_bar, robot, seed=3), 8))


@pytest.fixture(scope="module")
def points(patched_bar):
    return ~np.array(patched_bar.model.rows.turns)


@pytest.fixture(scope="module")
def stated(patched_bar, robot, places):
    """Calibrated with the first six of the places."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(calibration, "pressed_places", lambda *_: iter(places))
        return calibrated_contact(patched_bar, robot, 6)


def test_errors_are_those_of_the_sum_of_forces_and_of_the_tip(places, points):
    place = next(place for place in places if place.converged)
    (solved,) = place.full.solved
    on_obstacle = solved.lambda_c.reshape(-1, 3).sum(axis=0)
    force, tip = place.errors(points)
    own = place.learned.forces.sum(axis=0)
    assert np.linalg.norm(own - on_obstacle) == pytest.approx(force * np.linalg.norm(own), rel=1e-9)
    apart = np.linalg.norm(place.learned.delta_e[0] - solved.delta_e)
    assert apart == pytest.approx(tip * np.linalg.norm(place.learned.moved[0]), rel=1e-9)


def test_bounds_hold_at_other_places(stated, places, points):
    """Six places promise six of seven."""
    assert stated.probability == pytest.approx(stated.places / (stated.places + 1))
    assert stated.places + stated.left_out == 6 and stated.places >= 4
    others = [place for place in places[6:] if place.converged and place.learned.trusted]
    assert others
    for place in others:
        bounds = contact_error(stated, place.learned, points)
        force, moved = sizes(place.learned, points)
        off, apart = place.errors(points)
        assert off * force < bounds.force < 0.5 * force and apart * moved < bounds.tip < 0.5 * moved
    assert ContactError.model_validate_json(stated.model_dump_json()) == stated


def test_nothing_is_promised_of_states_that_are_not_trusted(stated, places, points):
    state = next(place.learned for place in places if place.converged and place.learned.trusted)
    for changes in ({"error": 1.01 * TRUSTED}, {"deep": True}, {"status": StepStatus.ITERATIONS}):
        bounds = contact_error(stated, replace(state, **changes), points)
        assert bounds.force == bounds.tip == np.inf
    assert bending(replace(state, error=0.0)) == 1.0 and bending(replace(state, error=5 * LEAST)) == pytest.approx(5.0)


def test_places_without_a_state_tell_nothing(patched_bar, robot, places, monkeypatch):
    deep = [replace(place, learned=replace(place.learned, deep=True)) for place in places]
    monkeypatch.setattr(calibration, "pressed_places", lambda *_: iter(deep))
    with pytest.raises(NumericalError, match="none of 3 contact places"):
        calibrated_contact(patched_bar, robot, 3)
