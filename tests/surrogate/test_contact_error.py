"""The error that a touched model states, at places of finite elements that it was not calibrated with."""

from dataclasses import replace
from itertools import islice
from types import SimpleNamespace

import numpy as np
import pytest

from cfem.condensed.model_error import ContactError
from cfem.core.errors import NumericalError
from cfem.equilibrium.contact.skinned_robot import SkinnedRobot
from cfem.equilibrium.contact.surfaces import SurfaceScene
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import displacement
from cfem.equilibrium.system.problem import Problem
from cfem.predict.contact.error import contact_error, touching
from cfem.predict.contact.step.bodies import Bodies, PlacedModel
from cfem.predict.contact.step.scene import ContactScene
from cfem.surrogate import contact_error as calibration
from cfem.surrogate.contact_error import AT_ONCE, calibrated_contact, error_at, pressed_places


@pytest.fixture(scope="module")
def alone(patched_bar):
    return Bodies([PlacedModel(patched_bar, itself=False)])


@pytest.fixture(scope="module")
def places(patched_bar, robot):
    """Of one, two and three obstacles."""
    return list(islice(pressed_places(patched_bar, robot, seed=3), 24))


@pytest.fixture(scope="module")
def known(places):
    return [place for place in places if place.known]


@pytest.fixture(scope="module")
def stated(patched_bar, known):
    return error_at(patched_bar, known[:6], 0, 0.0)


def test_errors_are_those_of_the_forces_and_of_how_they_move_the_tip(patched_bar, robot, known):
    place = next(place for place in known if not place.several)
    (solved,), delta = place.full.solved, place.learned.deltas[0]
    force, tip = place.errors(patched_bar)
    apart = place.learned.forces.sum(axis=0) - place.full.forces.sum(axis=0)
    assert np.linalg.norm(apart) == pytest.approx(force, rel=1e-9)
    free = solve(Problem(robot), displacement(delta)).delta_e
    moved = place.learned.delta_e[0] - patched_bar.model.at_displacement(delta).delta_e
    assert np.linalg.norm(moved - (solved.delta_e - free)) == pytest.approx(tip, rel=1e-4)


def test_the_motion_of_a_cable_that_goes_slack_is_motion_by_the_obstacle(patched_bar, known):
    """`answers.work` is of the robot at the actuators where the obstacle leaves them."""
    place, learned = known[0], known[0].learned
    answers = learned.answers._replace(work=np.zeros(4))
    slack = replace(place, learned=replace(learned, answers=answers, given=np.zeros(4)))
    assert slack.errors(patched_bar) == place.errors(patched_bar)


def test_several_obstacles_come_at_once_and_each_has_its_error(patched_bar, known):
    place = max(known, key=lambda place: len(touching(place.learned)))
    met = touching(place.learned)
    assert len(met) >= 2 and touching(place.full) == met
    mine = [place.learned.push[place.learned.among(0, number)].sum(axis=0) for number in met]
    theirs = [place.full.push[place.full.among(0, number)].sum(axis=0) for number in met]
    worst = np.linalg.norm(np.subtract(mine, theirs), axis=1).max()
    assert worst == pytest.approx(place.errors(patched_bar)[0], rel=1e-9)


def test_all_obstacles_of_a_place_touch_and_each_number_of_them_has_its_turn(known):
    assert len(known) >= 6
    for number, place in enumerate(known):
        assert (
            1 + number % 2 <= len(touching(place.learned)) == len(place.coming.kinds) <= AT_ONCE[number % len(AT_ONCE)]
        )


def test_finite_elements_are_not_asked_where_the_learned_state_is_not_trusted_on_the_way(
    patched_bar, robot, monkeypatch
):
    step, asked = calibration.contact_step, []

    def deep_at_second(*given, **more):
        asked.append(more["before"])
        return replace(step(*given, **more), deep=len(asked) == 2)

    monkeypatch.setattr(calibration, "contact_step", deep_at_second)
    monkeypatch.setattr(calibration, "SurfaceScene", None)
    place = next(pressed_places(patched_bar, robot, seed=3))
    assert len(asked) == 2 and not place.known and place.full is None


def test_bounds_hold_at_other_places(stated, patched_bar, alone, known):
    """A few places promise a few of one more, on average over which of them calibrate."""
    for factors in (stated.one, stated.several):
        assert factors.probability == pytest.approx(factors.places / (factors.places + 1))
    assert stated.probability == min(stated.one.probability, stated.several.probability)
    assert stated.most == max(len(touching(place.learned)) for place in known[:6])
    for place in known[6:]:
        force, count = contact_error([stated], alone, place.learned).force, len(touching(place.learned))
        assert (force < np.linalg.norm(place.learned.forces, axis=1).sum()) == (count <= stated.most)
    assert ContactError.model_validate_json(stated.model_dump_json()) == stated
    rng, within = np.random.default_rng(0), []
    groups = [[place for place in known if place.several is several] for several in (False, True)]
    for _ in range(30):
        mixed = [rng.permutation(len(places)) for places in groups]
        mine = [places[number] for places, order in zip(groups, mixed, strict=True) for number in order[:3]]
        others = [places[number] for places, order in zip(groups, mixed, strict=True) for number in order[3:]]
        calibrated = error_at(patched_bar, mine, 0, 0.0)
        for place in others:
            if len(touching(place.learned)) <= calibrated.most:
                bounds, (force, tip) = contact_error([calibrated], alone, place.learned), place.errors(patched_bar)
                within.append((force <= bounds.force, tip <= bounds.tip))
    assert len(within) > 100 and (np.mean(within, axis=0) >= stated.probability - 0.05).all()


def test_bounds_of_rigid_obstacles_hold_where_two_robots_press_each_other(patched_bar, robot, known):
    """A bar and its twin, upside down above."""
    stated = error_at(patched_bar, known, 0, 0.0)
    skin, pose = patched_bar.model.skin, (np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 16.0]))
    here = SkinnedRobot(robot, skin.nodes, skin.triangles, patched_bar.patches, itself=False)
    learned = ContactScene([PlacedModel(patched_bar, itself=False), PlacedModel(patched_bar, *pose, False)])
    fe, state, solved, within = SurfaceScene([here, replace(here, R=pose[0], t=pose[1])]), None, None, []
    for deltas in ([1.05], [0.95]), ([1.1], [1.0]), ([1.3], [1.2]), ([1.3], [1.3]):
        state, solved = learned.go(deltas, state), fe.go(deltas, solved)
        assert solved.converged and solved.pressed > 0.01
        bounds = contact_error([stated, stated], learned, state)
        assert bounds.force < 0.1 * state.pressed
        alone = (
            patched_bar.model.at_displacement(deltas[0]).delta_e - solve(here.problem, displacement(deltas[0])).delta_e
        )
        tip = np.linalg.norm(state.delta_e[0] - solved.solved[0].delta_e - alone)
        within += [abs(state.pressed - solved.pressed) <= bounds.force, tip <= bounds.tip]
    assert np.mean(within) >= stated.probability - 0.1


def test_one_obstacle_and_several_hold_as_promised_however_much_larger_the_errors_of_several_are(monkeypatch):
    """Made-up errors, those of several obstacles of a heavy tail."""
    monkeypatch.setattr(calibration, "expected_error", lambda *_: (1.0, 1.0))
    monkeypatch.setattr(calibration, "touching", lambda state: range(state.count))
    rng, within = np.random.default_rng(0), []
    draw = {False: rng.standard_normal, True: rng.standard_cauchy}

    def made_up(several, errors):
        state = SimpleNamespace(count=1 + several, push=np.ones((1, 3)))
        return SimpleNamespace(off=np.zeros(1), several=several, learned=state, errors=lambda _: tuple(errors))

    for _ in range(500):
        places = [made_up(several, np.abs(errors)) for several in draw for errors in draw[several]((20, 2))]
        stated = error_at(None, places, 0, 0.0)
        each = zip(draw.values(), (stated.one, stated.several), strict=True)
        within.append([[(np.abs(new(100)) <= most).mean() for most in (of.force, of.tip)] for new, of in each])
        assert max(stated.one.force, stated.one.tip) < 6
    assert stated.probability == 0.95
    assert np.allclose(np.mean(within, axis=0), 20 / 21, atol=0.01)


def test_what_is_not_trusted_is_left_out(patched_bar, robot, places, known, monkeypatch):
    monkeypatch.setattr(calibration, "pressed_places", lambda *_: iter(places))
    stated = calibrated_contact(patched_bar, robot, len(places))
    assert stated.one.places + stated.several.places == len(known)
    assert stated.left_out == len(places) - len(known)
    assert calibrated_contact(patched_bar, robot, 3) == error_at(
        patched_bar, known[:3], places.index(known[2]) - 2, 0.0
    )
    unknown = [replace(place, full=None) for place in places]
    monkeypatch.setattr(calibration, "pressed_places", lambda *_: iter(unknown))
    with pytest.raises(NumericalError, match="0 of 15 contact places"):
        calibrated_contact(patched_bar, robot, 3)
