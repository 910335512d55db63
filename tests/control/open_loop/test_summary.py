"""The headline says what a reader must not miss."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from cfem.control.open_loop.experiment import Tracked
from cfem.control.open_loop.summary import headline, judged, record, summarise
from cfem.control.search.goal_search import SearchResult, SearchStatus
from cfem.plant.protocol import Measurement

VERDICTS = ("reached", "reached", "reached", "out of reach")


def rows(controller: str, inside: bool, error: float) -> list[dict]:
    common = {"status": "converged", "plant_status": "converged", "softened": False, "iterations": 3, "step_us": 90.0}
    return [
        {**common, "controller": controller, "inside": inside, "error": error, "error_to_fe_based": error}
        | {"reachable": index < 3, "reached": index < 2, "kkt": 1e-12, "verdict": VERDICTS[index]}
        for index in range(4)
    ]


@pytest.mark.parametrize("inside", [True, False])
def test_plans_outside_the_training_states_are_flagged(inside):
    found = summarise(rows("spectral", inside, 0.2), length=100.0)
    (line,) = headline({"circle": found})
    assert ("4 plans OUTSIDE" in line) is not inside
    assert "2 of 4 goals reached" in line and "90 µs per control step" in line
    assert "tracking error mean 0.2 mm, max 0.2 mm" in line
    assert "1 goal is out of reach: the robot ended 0.2 mm away;" in line


@pytest.mark.parametrize("plant, judged", [("fem", "on the mesh of the model"), ("model", "by the model alone")])
def test_an_error_says_whether_a_mesh_or_the_model_itself_judges(plant, judged):
    (line,) = headline({"circle": summarise(rows("spectral", True, 0.2), length=100.0)}, plant=plant)
    assert f"tracking error mean 0.2 mm, max 0.2 mm, {judged};" in line


def test_the_headline_has_orientation_errors_in_degrees():
    turned = [
        row | {"rotation_error": error}
        for row, error in zip(rows("spectral", True, 0.2), (0.1, 0.3, 0.2, 0.2), strict=True)
    ]
    (line,) = headline({"place": summarise(turned, length=100.0)})
    assert "orientation error mean 0.2 deg, max 0.3 deg" in line
    (line,) = headline({"place": summarise(rows("spectral", True, 0.2), length=100.0)})
    assert "orientation" not in line


@pytest.mark.parametrize("yaw, reached", [(0.05, True), (0.2, False)])
def test_a_goal_is_reached_where_the_orientation_that_it_states_is(yaw, reached):
    goal, there = np.zeros(6), np.array([1e-3, 0, 0, 0.5, 0.5, np.radians(yaw)])
    condensed = SimpleNamespace()
    plan = SearchResult(
        *(np.zeros(2),) * 3,
        *(0.0, SearchStatus.CONVERGED, 1, 1, False, 0.0, 0.0, SimpleNamespace(condensed=condensed), None, None),
    )
    measured = Measurement(there, np.zeros(2), np.zeros(2), 1, "converged")
    places, yaw_alone = np.arange(6) < 3, np.arange(6) == 5
    tracked = Tracked("m", 0, goal, plan, measured, True, 0.0, places, yaw_alone)
    by_fe = replace(tracked, measured=replace(measured, x_e=there + np.array([0.03, 0.04, 0, 0, 0, 0])))
    row = record("t", tracked, 0.05, by_fe, None, np.radians(0.1))
    assert row["error_to_fe_based"] == pytest.approx(0.05)
    assert np.isnan(record("t", tracked, 0.05, None)["error_to_fe_based"])
    assert row["rotation_error"] == pytest.approx(yaw) and row["error"] == pytest.approx(1e-3)
    assert bool(row["reached"]) is reached


DISCRETISATION = {
    "states": 3,
    "cells": 1000,
    "finer_cells": 2500,
    "tip_mm": 0.3,
    "tip_percent": 0.25,
    "force_percent": 1.5,
    "reach_percent": 0.4,
}


@pytest.mark.parametrize("error, leads", [(1e-6, True), (0.5, False)])
def test_the_discretisation_error_leads_where_it_is_the_larger_one(error, leads):
    lines = headline({"circle": summarise(rows("spectral", True, error), 100.0)}, DISCRETISATION)
    (place,) = (
        index for index, line in enumerate(lines) if "0.3 mm uncertain at the tip (0.25 % of the length)" in line
    )
    assert len(lines) == 2 and (place == 0) is leads


def test_goals_out_of_reach_lead_where_nothing_was_reached():
    far = [
        {**row, "reachable": False, "reached": False, "verdict": "out of reach"}
        for row in rows("spectral", True, 203.0)
    ]
    first, second = headline({"circle": summarise(far, 100.0)}, {**DISCRETISATION, "states": 1})
    assert "0 of 4 goals reached; 4 goals are out of reach: the robot ended 203 mm away" in first
    assert "(estimated: rest and 1 state on" in second


def test_a_discretisation_error_that_is_not_known_is_said_to_be_so():
    left_out = {"left_out": "mesh_error is null in the spec"}
    *_, last = headline({"circle": summarise(rows("spectral", True, 0.2), 100.0)}, left_out)
    assert last == "discretisation error: not estimated (mesh_error is null in the spec)"


def test_the_time_of_a_step_stands_beside_that_of_an_fe_solve():
    cost = {"solves": 4, "seconds": 2.0}
    (line,) = headline({"circle": summarise(rows("spectral", True, 0.2), 100.0)}, fe_cost=cost)
    assert "90 µs per control step (an FE solve takes 500 ms)" in line


def test_distances_are_also_shares_of_the_length():
    near = summarise(rows("spectral", True, 0.2), length=100.0)["spectral"]["distance_to_reachable_goals"]
    assert near == pytest.approx({"mean": 0.2, "max": 0.2, "mean_percent": 0.2, "max_percent": 0.2})


def test_weights_that_leave_rows_out_are_said_with_the_error():
    (line,) = headline({"circle": summarise(rows("spectral", True, 0.2), 100.0, ["tip.x", "tip.z"])})
    assert "tracking error of tip.x, tip.z alone (search.weights) mean 0.2 mm" in line


def of(count: int, reached: int, verdict: str, controller: str = "spectral") -> list[dict]:
    row = {**rows(controller, True, 5.0)[0], "reached": False, "reachable": verdict != "out of reach"}
    there = {**row, "reached": True, "reachable": True, "verdict": "reached", "error": 1e-3}
    return [there] * reached + [{**row, "verdict": verdict}] * (count - reached)


def said(found: list[dict], beyond: bool = False) -> list[str]:
    return [one["what"] for one in judged({"t": summarise(found, 100.0)}, {"t": beyond})]


def test_searches_that_did_not_converge_make_a_run_poor_and_are_no_verdict_on_the_goals():
    found = of(24, 23, "not converged")
    (what,) = said(found)
    assert "the search for 1 of 24 goals did not converge" in what
    (line,) = headline({"t": summarise(found, 100.0)})
    assert "the search for 1 of them did NOT CONVERGE" in line and "out of reach" not in line


def test_a_run_is_poor_that_misses_most_goals_and_says_how_many_are_out_of_reach():
    assert said(of(24, 12, "out of reach")) == []
    (what,) = said(of(24, 11, "out of reach"))
    assert what == "t, spectral: 13 of 24 goals are missed, and 13 of them are out of reach"
    (what,) = said(of(3, 0, "reached"))
    assert what == "t, spectral: 3 of 3 goals are missed, and 0 of them are out of reach"


def test_a_trajectory_that_is_meant_to_leave_the_reach_is_judged_by_the_goals_within():
    assert said(of(24, 11, "out of reach"), beyond=True) == []
    assert said(of(4, 0, "out of reach"), beyond=True) == []
    (what,) = said(of(4, 1, "reached"), beyond=True)
    assert "3 of 4 goals are missed" in what


def test_a_goal_where_the_robot_has_been_is_never_called_out_of_reach():
    """The model errs: to first order it cannot come nearer, and the robot was there."""
    condensed = SimpleNamespace()
    plan = SearchResult(
        *(np.zeros(2),) * 3,
        *(0.3, SearchStatus.NO_DESCENT, 1, 1, False, 0.0, 0.0, SimpleNamespace(condensed=condensed), None, None),
        tried=True,
    )
    measured = Measurement(np.array([0.2, 0.0, 0.0]), np.zeros(2), np.zeros(2), 1, "converged")
    tracked = Tracked("m", 0, np.zeros(3), plan, measured, True, 0.0, np.ones(3, bool), np.zeros(3, bool))
    assert record("t", tracked, 0.1, None)["verdict"] == "out of reach"
    row = record("t", tracked, 0.1, None, been_there=True)
    assert row["verdict"] == "misplaced by the model" and row["reachable"] and not row["reached"]
    found = summarise([row], 100.0)["m"]
    assert [found[key] for key in ("reachable", "missed", "misplaced", "not_converged")] == [1, 1, 1, 0]
    what, _ = (one["what"] for one in judged({"t": {"m": found}}, {"t": False}))
    assert what.startswith("t, m: the model takes 1 of 1 goals for out of reach, and the robot has been there")


def goal_row(world=None, bounds=None, **plan) -> dict:
    """Row of a goal at which the plant stands as planned."""
    condensed = SimpleNamespace(bounds=bounds)
    searched = SearchResult(
        *(np.zeros(2), np.zeros(2), np.zeros(3)),
        *(0.0, SearchStatus.CONVERGED, 4, 9, False, 0.0, 2e-3, SimpleNamespace(condensed=condensed), None, None),
    )
    measured = Measurement(np.zeros(3), np.zeros(2), np.zeros(2), 1, "converged")
    every, none = np.ones(3, bool), np.zeros(3, bool)
    tracked = Tracked("m", 0, np.zeros(3), replace(searched, **plan), measured, True, 0.0, every, none)
    return record("t", tracked, 0.1, None, world)


@pytest.mark.parametrize("model_error", [0.0, 0.25, np.inf])
def test_a_row_has_the_error_that_the_model_states(model_error):
    assert goal_row(model_error=model_error)["model_error"] == model_error


def test_a_row_has_no_error_where_the_model_states_none():
    assert np.isnan(goal_row()["model_error"]) and "force_error" not in goal_row()


def test_a_row_among_obstacles_has_the_error_of_their_forces():
    world = SimpleNamespace(met=lambda delta_e, reached: True)
    assert goal_row(world, SimpleNamespace(force=0.02))["force_error"] == 0.02
    assert np.isnan(goal_row(world)["force_error"])


def test_a_goal_among_obstacles_is_reached_where_its_forces_are():
    held = SimpleNamespace(met=lambda delta_e, reached: True)
    missed = SimpleNamespace(met=lambda delta_e, reached: False)
    row, beside = goal_row(held), goal_row(missed, status=SearchStatus.NO_ANSWER)
    assert row["reached"] and row["verdict"] == "reached"
    assert not beside["reached"] and beside["verdict"] == "not converged"


@pytest.mark.parametrize("iterations, step_us", [(4, 500.0), (1, 2000.0), (0, 2000.0)])
def test_the_time_of_a_step_is_that_of_the_search_over_its_iterations(iterations, step_us):
    assert goal_row(iterations=iterations)["step_us"] == pytest.approx(step_us, rel=1e-12)


def test_what_fewer_iterations_cost_is_no_doubt_of_the_run():
    assert said(of(4, 0, "not converged", "spectral@1")) == []
