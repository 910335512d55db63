import json
from dataclasses import replace

import numpy as np
import pytest
from support.arc_robot import LENGTH, REACH, REST_E, ArcRobot, tip

from cfem.condensed.strokes import ridge_of
from cfem.control.closed_loop.controller import Controller
from cfem.control.closed_loop.tick import Pilot
from cfem.control.open_loop.experiment import follow
from cfem.control.open_loop.summary import record, summarise
from cfem.control.search.goal_search import SearchSettings
from cfem.control.search.inverse import Limits
from cfem.plant.model_plant import ModelPlant

FULL = SearchSettings()
TRUE, SOFTER = ArcRobot(), ArcRobot(stiffness=0.9)
GOALS = np.array([REST_E + tip(np.array([s, s - 0.5])) for s in np.linspace(4, 12, 8)])


PULLING = Limits.of(REACH, np.array([True, True]))


def pilot(model, settings=FULL):
    ridge = ridge_of(1e-10, REACH, LENGTH)
    return Pilot(model, "displacement", "equilibrium", PULLING, np.ones(3), ridge, settings, approach=FULL)


def run(goals=GOALS):
    seen = []
    pilots = {
        "learned": pilot(SOFTER),
        "learned@1": pilot(SOFTER, replace(FULL, iterations=1)),
        "fe-based": pilot(TRUE),
    }
    judge = "fe-based", Controller(pilots["fe-based"], REST_E)
    tracked = follow(goals, pilots, ModelPlant(TRUE, REST_E), REST_E, judge, seen.append)
    return [one for goal in tracked for one in goal], seen


def test_every_goal_by_every_controller_in_order():
    tracked, seen = run()
    assert seen == list(range(len(GOALS)))
    assert [one.controller for one in tracked[:3]] == ["fe-based", "learned", "learned@1"]
    # Displacements prescribe the shape: a model that errs in stiffness alone tracks as well.
    assert max(one.error for one in tracked if one.controller == "learned") < 1e-4


def test_one_step_a_goal_lags_behind():
    tracked, _ = run()
    errors = {name: np.mean([t.error for t in tracked if t.controller == name]) for name in ("learned", "learned@1")}
    assert errors["learned@1"] > 10 * errors["learned"]
    assert [t.plan.iterations for t in tracked if t.controller == "learned@1"][1:] == [1] * (len(GOALS) - 1)


def test_summary_is_plain_json_and_judges_reach_by_fe():
    far = np.array([[0.0, 200.0, 0.0]])
    tracked, _ = run(np.vstack([GOALS, far]))
    fe = {one.index: one for one in tracked if one.controller == "fe-based"}
    found = summarise([record("curve", one, 0.1, fe[one.index]) for one in tracked], LENGTH)
    json.dumps(found, allow_nan=False)
    assert found["learned@1"]["reachable"] == len(GOALS)
    assert found["fe-based"]["distance_to_fe_based"] is None
    assert found["learned"]["distance_to_reachable_goals"]["max_percent"] == pytest.approx(
        100 / LENGTH * found["learned"]["distance_to_reachable_goals"]["max"]
    )
