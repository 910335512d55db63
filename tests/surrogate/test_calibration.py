"""The error that a model states, on the synthetic robot: does it hold in states that nobody calibrated it with?"""

import json
from dataclasses import replace

import numpy as np
import pytest
from surrogate.synthetic import dataset

from cfem.condensed.model_error import ModelError
from cfem.condensed.strokes import ridge_of
from cfem.control.closed_loop.tick import Pilot
from cfem.control.open_loop.experiment import follow
from cfem.control.open_loop.summary import record
from cfem.control.search.goal_search import SearchSettings
from cfem.control.search.inverse import Limits
from cfem.plant.model_plant import ModelPlant
from cfem.predict.load import build
from cfem.predict.loads.loaded import loaded
from cfem.predict.series.state_error import LOADS
from cfem.surrogate.calibration import ENOUGH, STEEPEST, answers, bound, calibrated, powers
from cfem.surrogate.spec import SpectralSpec
from cfem.surrogate.stage import train_and_judge


def stating(training, test, form="displacement"):
    """The model of these states, which states its error."""
    meta, arrays, _ = train_and_judge(training, test, SpectralSpec(kind="spectral", form=form))
    return build({**meta, "model_error": json.loads(json.dumps(calibrated(build(meta, arrays), test)))}, arrays)


def forced(test):
    """The states as of a plan that draws forces."""
    return replace(test, meta={**test.meta, "plan": {"space": "force"}})


@pytest.fixture(scope="module")
def model():
    return stating(dataset(30, 1), dataset(200, 2))


@pytest.mark.parametrize("form, by", [("displacement", lambda test: test), ("force", forced)])
def test_it_holds_in_the_stated_share_of_other_states(form, by):
    model, fresh = stating(dataset(20, 1), by(dataset(200, 2)), form), by(dataset(400, 3))
    command = model.model_error.command
    assert command == ("force" if by is forced else "displacement") and model.model_error.probability == 0.95
    states, answered = answers(model, fresh, command)
    true, stated = fresh.take(answered), model.error(states)
    reaction = states.delta_a - true.delta_a if by is forced else states.lambda_a - true.lambda_a
    for error, most in (
        (np.linalg.norm(states.delta_e - true.delta_e, axis=1), stated.tip),
        (np.abs(reaction), stated.actuators),
        (np.abs(states.W - true.W), stated.W),
    ):
        held = (error <= most).reshape(len(error), -1).all(axis=1)
        assert 0.90 <= held.mean() < 1.0  # of 200 calibration states: 0.95 with a deviation of 0.02


def test_a_bound_by_place_is_sharper_than_one_for_all(model):
    states, answered = answers(model, dataset(400, 3), "displacement")
    assert np.median(model.error(states).tip) < 0.5 * model.model_error.tip.everywhere
    error = np.linalg.norm(states.delta_e - dataset(400, 3).delta_e[answered], axis=1)
    assert 0.90 <= (error <= model.model_error.tip.everywhere).mean() <= 1.0


def test_beyond_the_domain_nothing_is_promised(model):
    beyond = model.error(model.at_displacement(model.domain.delta_a[1] + 2.0))
    assert not beyond.inside and np.isinf(beyond.tip) and np.isinf(beyond.actuators).all() and np.isinf(beyond.W).all()
    near = model.error(model.at_displacement(model.trained[0]))
    assert near.inside and near.actuators.shape == (2,) and near.W.shape == (5, 5)


@pytest.mark.parametrize("n", [4, 8, ENOUGH, 30, 99])
def test_a_further_value_exceeds_the_bound_as_seldom_as_ranks_say(n):
    """Whatever the distribution, and with the power fitted: k / (n + 1), by counting draws."""
    rng, draws, held = np.random.default_rng(n), 1500, 0
    for _ in range(draws):
        L = np.exp(rng.normal(size=n + 1))
        errors = L**2 * np.exp(rng.normal(size=n + 1))
        stated = bound(errors[:-1], L[:-1])
        held += errors[-1] <= stated.at(L[-1])
    promised = min(n, np.ceil(0.95 * (n + 1))) / (n + 1)
    assert held / draws == pytest.approx(promised, abs=0.03)


def test_powers_are_the_slopes_of_fits_without_each_state():
    rng = np.random.default_rng(1)
    L = np.exp(rng.normal(size=7))
    errors = L**1.5 * np.exp(0.1 * rng.normal(size=7))
    every, without = powers(errors, L)
    assert every == pytest.approx(np.polyfit(np.log(L), np.log(errors), 1)[0])
    fits = [np.polyfit(np.log(np.delete(L, i)), np.log(np.delete(errors, i)), 1)[0] for i in range(7)]
    assert without == pytest.approx(fits)
    assert powers(L**20, L)[0] == STEEPEST and powers(1 / L, L)[0] == 0.0
    assert powers(np.array([2.0]), np.array([3.0]))[0] == 0.0 and bound(np.zeros(3), L[:3]).at(5.0) == 0.0


def test_few_test_states_promise_less(model):
    few = ModelError.model_validate(calibrated(model, dataset(9, 2)))
    assert few.states + few.left_out == 9 and few.probability == few.states / (few.states + 1)


def test_where_no_test_state_is_in_the_domain_nothing_is_stated(model):
    away = dataset(3, 2)
    assert calibrated(model, replace(away, delta_a=away.delta_a + 25.0)) is None


def test_forces_of_a_stiffer_robot_err_by_more_as_they_are_larger():
    model = stating(dataset(60, 1, parameters=True), dataset(40, 2, parameters=True))
    place, soft, stiff = model.trained[0], [0.4, 3.0], [0.4, 6.0]
    errors = [model.error(model.at_displacement(place, p), p) for p in (soft, stiff)]
    assert errors[1].actuators == pytest.approx(2 * errors[0].actuators) and errors[1].tip == errors[0].tip
    assert pytest.approx(errors[0].W) == 2 * errors[1].W


def test_a_plan_of_control_has_the_bound_of_its_state(model):
    goals = model.rest_e + model.at_displacement(model.trained[:2]).delta_e
    ridge, limits = ridge_of(1e-10, model.reach, model.length), Limits.of(model.reach, np.array([True, True]))
    settings = SearchSettings()
    pilot = Pilot(model, "displacement", "equilibrium", limits, np.ones(3), ridge, settings, approach=settings)
    for (tracked,) in follow(goals, {"learned": pilot}, ModelPlant(model, model.rest_e), model.rest_e):
        state = tracked.plan.iterate.condensed
        assert record("round", tracked, 0.1, None)["model_error"] == model.error(state).tip > 0


def test_loads_that_no_sample_carried_widen_the_bound_of_the_tip_alone(model):
    under_load = loaded(model, [0.0, 0.005, 0.0])
    place = model.trained[0]
    widened, own = (each.error(each.at_displacement(place)) for each in (under_load, model))
    assert own.probability == 0.95 and widened.probability is None  # the part of the loads is an estimate
    assert widened.tip == pytest.approx(own.tip + LOADS * under_load.meta["wrench_error"]) and widened.tip > own.tip
    assert np.isnan(widened.actuators).all() and np.isnan(widened.W).all()
