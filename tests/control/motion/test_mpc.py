"""Predictive control of the bar: what it gains over controllers that do not know of time, and what it keeps."""

import numpy as np
import pytest
from control.motion.bar import errors, mpc, plant, robot, standing, static, swing

from cfem.control.motion import mpc as mpc_module
from cfem.control.motion.horizon import HalfSpace
from cfem.control.motion.mpc import AGAIN, PATIENCE, RETREAT
from cfem.control.motion.observer import Doubt
from cfem.core.errors import NumericalError

HALF = 16.6  # Hz, half of the bar's first frequency
NOISE = 0.02
WRONG = {"stiffness": 1.1, "viscosity": 1.2, "noise": NOISE, "delay": 1}


def test_fast_goals_are_followed_by_a_robot_that_is_not_the_model_s():
    """One cable moves one of three coordinates: what is left of the error is mostly what no command takes away."""
    start, goals = standing(2.4), swing(HALF, 130)
    missed = {
        "static": errors(static(start), plant(2.4, **WRONG), goals)[0],
        "pi": errors(static(start, integral=0.05), plant(2.4, **WRONG), goals)[0],
        "mpc": errors(mpc(start, doubt=Doubt(noise=NOISE)), plant(2.4, **WRONG), goals)[0],
    }
    best = errors(mpc(start), plant(2.4), goals)[0][80:].mean()  # right model, no noise
    mean = {name: one[80:].mean() for name, one in missed.items()}
    assert mean["mpc"] < 0.3 * mean["static"] and mean["mpc"] < 0.5 * mean["pi"]
    assert mean["mpc"] < 1.2 * best


def test_without_sensors_it_is_the_inverse_of_the_dynamics():
    start, goals = standing(2.4), swing(HALF, 150)
    ahead, behind = (errors(one, plant(2.4), goals)[0][60:].mean() for one in (mpc(start), static(start)))
    assert ahead < 0.45 * behind


@pytest.mark.parametrize("kind", ["force", "displacement"])
def test_a_goal_that_stays_is_reached(kind):
    """Whatever the stiffness: the observer's offset takes in what is wrong at rest."""
    begin, end = (2.4, 3.0) if kind == "force" else (1.5, 1.9)
    goals = np.repeat((robot().rest_e + standing(end, kind).delta_e)[None], 140, axis=0)
    controller = mpc(standing(begin, kind), kind, Doubt(noise=0.005))
    missed, _ = errors(controller, plant(begin, kind, stiffness=1.15), goals, kind)
    assert missed[0] > 0.3 and missed[110:].max() < 0.02


def test_commands_keep_their_bounds_and_rate():
    start, goals = standing(2.4), swing(HALF, 120)
    free = errors(mpc(start), plant(2.4), goals)[1]
    _, u = errors(mpc(start, rate=0.15, highest=2.7), plant(2.4), goals)
    steps = np.abs(np.diff(np.concatenate([[[2.4]], u]), axis=0))
    assert free.max() > 2.9 and u.max() == pytest.approx(2.7)
    assert steps.max() == pytest.approx(0.15)


def test_the_tip_stays_on_its_side_of_a_plane():
    """As predicted, by a robot that is the model's."""
    start, goals = standing(2.4), swing(HALF / 2, 110)
    positions = {}
    for name, planes in (("free", ()), ("kept", (HalfSpace(np.array([0.0, 0.0, -1.0]), -goals[:, 2].mean()),))):
        body, controller, found = plant(2.4), mpc(start, planes=planes), []
        for k, goal in enumerate(goals):
            body.step(controller.tick(goal, None, goals[k:]).u, "force")
            found.append(body.actual.x_e[2])
        positions[name] = np.array(found)
    beyond = {name: (found - goals[:, 2].mean()).max() for name, found in positions.items()}
    assert beyond["free"] > 0.3 and beyond["kept"] < 0.03


def test_a_tick_that_fails_sends_what_was_planned():
    start, goals = standing(2.4), swing(HALF, 30)
    controller = mpc(start)
    for k in range(10):
        controller.tick(goals[k], None, goals[k:])
    planned = controller._ahead[0].copy()
    told = controller.tick(np.full(3, np.nan))
    np.testing.assert_array_equal(told.u, planned)
    assert told.status != "converged" and np.isfinite(told.delta_a).all()
    assert controller.tick(goals[11], None, goals[11:]).status == "converged"


@pytest.mark.parametrize("closed", [False, True])
def test_without_a_plan_it_sends_what_was_planned_and_then_retreats_home(monkeypatch, closed):
    """By a share of what is left, within the rate; with an observer it begins again, and once more after AGAIN
    ticks."""
    rate, home = 0.1, 2.4
    controller = mpc(standing(home), doubt=Doubt(noise=NOISE) if closed else None, rate=rate, ticks=PATIENCE + 4)
    goals = swing(HALF, 60)
    for k in range(22):
        controller.tick(goals[k], None, goals[k:])
    planned, began = controller._ahead.copy(), []
    assert abs(planned[PATIENCE - 1, 0] - home) > 1.5 * rate

    def none(self, now, goals):
        raise NumericalError("no plan")

    monkeypatch.setattr(mpc_module.Mpc, "_solve", none)
    if closed:
        reset = controller.observer.reset
        controller.observer.reset = lambda u: began.append((u.copy(), reset(u))[0])
    for k in range(PATIENCE):
        told = controller.tick(goals[22])
        np.testing.assert_array_equal(told.u, planned[k])
        assert told.status == "no plan" and not told.restarted
    for k in range(2 * AGAIN):
        before = told.u[0]
        told = controller.tick(goals[22])
        assert told.u[0] - before == pytest.approx(np.clip(RETREAT * (home - before), -rate, rate), abs=1e-12)
        assert told.restarted == (closed and k % AGAIN == 0)
        np.testing.assert_array_equal(controller._ahead, np.full((PATIENCE + 4, 1), told.u[0]))
    assert told.u[0] == pytest.approx(home, abs=1e-6) and len(began) == 2 * closed
    monkeypatch.undo()
    assert controller.tick(goals[22], None, goals[22:]).status == "converged"
    assert controller._lost == 0


def test_after_lost_ticks_it_plans_about_where_the_robot_is(monkeypatch):
    controller, asked = mpc(standing(2.4)), []
    controller._lost = 3
    controller._states = controller._states + 5.0
    solve = mpc_module.Mpc._solve
    monkeypatch.setattr(
        mpc_module.Mpc, "_solve", lambda self, now, goals: asked.append(self._states) or solve(self, now, goals)
    )
    now = controller._state.z
    controller.tick(swing(HALF, 2)[0])
    np.testing.assert_array_equal(asked[0], np.repeat(now[None], 16, axis=0))
