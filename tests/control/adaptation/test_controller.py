"""Loops with adaptation against the same without: better on a robot that has changed, never much worse on any."""

from contextlib import suppress

import numpy as np
import pytest
from support.fast_cases import fast_are
from surrogate.stored import train_folder

from cfem.condensed.model import under_force
from cfem.condensed.strokes import ridge_of
from cfem.control.adaptation.controller import AdaptiveController
from cfem.control.adaptation.tracker import Tracker
from cfem.control.closed_loop.controller import Controller
from cfem.control.closed_loop.tick import Pilot
from cfem.control.search.goal_search import SearchSettings
from cfem.control.search.inverse import Limits
from cfem.core.errors import NumericalError
from cfem.equilibrium.quasi_static import CONVERGED
from cfem.plant.gains import Gains
from cfem.plant.protocol import Measurement
from cfem.predict.at_parameters import AtParameters
from cfem.predict.load import load_model

TICKS, NOISE, FEEDBACK = 80, 0.05, Gains(0.0, 0.2)


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    folder = train_folder(tmp_path_factory.mktemp("loop"), "{kind: spectral, max_degree: 8}", train=80, parameters=True)
    return load_model(folder)


def first(model):
    return np.array([one.reference for one in model.parameters])


def goals(model):
    turn = 2 * np.pi * np.arange(TICKS) / 40
    share = np.column_stack([0.4 + 0.2 * np.cos(turn), 0.4 + 0.2 * np.sin(turn)])
    known = AtParameters(model, first(model))
    near, found = known.at_displacement(0.2 * model.reach[:, 1]), []
    for u in share * model.domain.lambda_a[1]:
        near = under_force(known, u, near)
        found.append(model.rest_e + near.delta_e)
    return np.array(found)


def pilot_at(model):
    """Pilot of the model at its first parameters, by forces."""
    limits = Limits(np.array([[0.0, 3 * model.domain.lambda_a[1].max()]] * 2), model.reach * [[1, 1.5]] - [[1, 0]])
    ridge = ridge_of(1e-10, model.reach, model.length)
    return Pilot(
        AtParameters(model, first(model)),
        "force",
        "equilibrium",
        limits,
        np.ones(3),
        ridge,
        SearchSettings(20, 1e-5, 3.0),
    )


def run(model, aims, adapt, p_of, seed=0, noise=NOISE, delay=1, spoil=lambda rng, x: x, gains=FEEDBACK, loss=0.0):
    pilot = pilot_at(model)
    if adapt:
        controller = AdaptiveController(
            pilot, model.rest_e, Tracker(model, "force", NOISE, forget=20, loss=loss), gains
        )
    else:
        controller = Controller(pilot, model.rest_e, gains)
    rng, real, errors, samples, measured = np.random.default_rng(seed), AtParameters(model, first(model)), [], [], None
    there = real.at_displacement(0.2 * model.reach[:, 1])
    for tick, goal in enumerate(aims, 1):
        u = controller.tick(goal, measured).u
        assert np.isfinite(u).all()
        real.p = p_of(tick)
        with suppress(NumericalError):
            there = under_force(real, u, real.at_displacement(there.delta_a))
        x = model.rest_e + there.delta_e
        errors.append(np.linalg.norm(x - goal))
        samples.append(Measurement(spoil(rng, x + noise * rng.normal(size=3)), None, None, tick, "converged"))
        measured = samples[-1 - delay] if tick > delay else None
    return np.array(errors), controller


@pytest.mark.slow
def test_a_drifting_robot_is_followed_better(model):
    place = [one.name for one in model.parameters].index("young")
    aims, half = goals(model), TICKS // 2

    def p_of(tick):
        p = first(model) * 1.05
        p[place] = first(model)[place] * (1 - 0.1 * tick / TICKS)
        return p

    plain, _ = run(model, aims, False, p_of)
    adaptive, _ = run(model, aims, True, p_of)
    rms = [np.sqrt(np.mean(one[half:] ** 2)) for one in (plain, adaptive)]
    assert rms[1] < 0.5 * rms[0]


def test_a_sample_that_does_not_fit_is_told_of_and_the_next_one_is_not(model):
    """Without feedback too: the account of a loop counts what the tracker rejects."""
    controller = AdaptiveController(pilot_at(model), model.rest_e, Tracker(model, "force", NOISE), None)
    told = []
    for tick, goal in enumerate(goals(model)[:12], 1):
        at = controller.belief.iterate.condensed.delta_e
        x_e = model.rest_e + at + (40.0 if tick == 10 else 0.0)
        told.append(controller.tick(goal, Measurement(x_e, None, None, tick - 1, CONVERGED)).rejected)
    assert told == [tick == 10 for tick in range(1, 13)]


def test_open_loop_adapts_too(model):
    real = first(model) * 1.05
    plain, _ = run(model, goals(model), False, lambda tick: real, gains=None)
    adaptive, _ = run(model, goals(model), True, lambda tick: real, gains=None)
    assert adaptive[40:].mean() < 0.3 * plain[40:].mean()


def test_what_the_feedback_added_for_the_model_before_is_taken_back(model):
    """A change of the model that accounts for the integral leaves no integral."""
    real = first(model) * 1.05
    _, controller = run(model, goals(model), True, lambda tick: real)
    _, plain = run(model, goals(model), False, lambda tick: real)
    assert np.linalg.norm(controller.feedback.total) < 0.5 * np.linalg.norm(plain.feedback.total)


def test_the_integral_gives_back_what_the_new_parameters_account_for_and_no_more(model):
    """Under one command the change of parameters moves the tip by a known shift; of an integral of 1.5 shifts against
    it, half of one stays, and of an integral that points the same way all of it."""
    for share, left in [(-1.5, -0.5), (0.5, 0.5)]:
        tracker = Tracker(model, "force", NOISE)
        controller = AdaptiveController(pilot_at(model), model.rest_e, tracker, FEEDBACK)
        controller.tick(goals(model)[0])
        old = controller.belief.iterate.condensed
        tracker._used = tracker._used + 0.1
        real = AtParameters(model, tracker.used_p)
        shift = under_force(real, controller.belief.u, real.at_displacement(old.delta_a)).delta_e - old.delta_e
        assert np.abs(shift).max() > 0.01
        controller.feedback.total = share * shift
        controller._changed()
        np.testing.assert_allclose(controller.feedback.total, left * shift, atol=1e-9)


def strange(model, seed):
    """A robot that nobody expects; benchmarks/adaptation.py has a thousand."""
    rng = np.random.default_rng(seed)
    low, high = np.array([[one.low, one.high] for one in model.parameters]).T
    p = rng.uniform(low, high)
    place = [one.name for one in model.parameters].index("young")
    p[place] = first(model)[place] * np.exp(rng.uniform(-0.9, 0.9))
    later, when = p.copy(), rng.integers(20, 200)
    later[place] *= np.exp(rng.uniform(-0.6, 0.6))
    chance, missing = rng.uniform(0, 0.2), rng.uniform(0, 0.3)

    def spoil(noise, x):
        return np.full_like(x, np.nan) if noise.random() < missing else x + (30.0 * (noise.random() < chance))

    return {
        "p_of": lambda tick: p if tick < when else later,
        "noise": rng.uniform(0.01, 0.2),
        "delay": int(rng.integers(0, 3)),
        "spoil": spoil,
        "seed": seed,
    }


@pytest.mark.parametrize("seed", fast_are({0}, range(8)))
def test_no_robot_is_made_much_worse(model, seed):
    aims, wild = goals(model), strange(model, seed)
    plain, _ = run(model, aims, False, **wild)
    adaptive, controller = run(model, aims, True, loss=0.05 if seed % 2 else 0.0, **wild)
    rms = [np.sqrt(np.mean(one[TICKS // 2 :] ** 2)) for one in (plain, adaptive)]
    assert rms[1] < 1.5 * rms[0] + 1.0
    assert all(one.low * 0.999 <= value <= one.high * 1.001
               for one, value in zip(model.parameters, controller.tracker.used_p, strict=True))  # fmt: skip
