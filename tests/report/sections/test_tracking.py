"""Tracking on the page, of results made up."""

import numpy as np
import pytest

from cfem.report.sections.summary import tracking_summary
from cfem.report.sections.tracking import (
    Tracking,
    effort_charts,
    looser,
    places,
    planes,
    tracking_section,
    tracking_table,
    trajectory_charts,
)

UNITS = {"left": ("mm", "N"), "top": ("mm³", "MPa")}


def result(errors, reachable, step_us, **more):
    near = [e for e, can in zip(errors, reachable, strict=True) if can and np.isfinite(e)]
    spread = {"mean": float(np.mean(near)), "max": max(near)} if near else None
    return {
        "goals": len(errors),
        "reachable": sum(reachable),
        "distance_to_reachable_goals": spread,
        "distance_to_fe_based": None,
        "iterations_mean": 2.0,
        "step_us": {"median": step_us, "p99": 2 * step_us},
        "kkt_max": 1e-12,
        "not_converged": 0,
        **more,
    }


def tracking(errors=(0.01, 0.02, 0.03, 0.04), reachable=(True,) * 4, controllers=("fe-based", "spectral"), **more):
    """Every controller with the same errors; FE-based steps take 50 ms, others 0.2 ms."""
    m, k = len(errors), len(controllers)
    goals = np.array([[0.0, 10.0 * i, -120 + i * i, 0.5] for i in range(m)])
    columns = {
        "trajectory": np.array(["my-curve"] * m * k),
        "controller": np.repeat(controllers, m),
        "goal_index": np.tile(np.arange(m), k),
        "goal": np.tile(goals, (k, 1)),
        "x_e": np.tile(goals + 0.01, (k, 1)),
        "error": np.tile(errors, k),
        "lambda_a": np.tile([[0.03, 0.2]], (m * k, 1)),
        "reachable": np.tile(reachable, k),
        "verdict": np.tile(np.where(reachable, "reached", "out of reach").astype(object), k),
        "inside": np.ones(m * k, bool),
        "step_us": np.repeat([50_000.0 if one == "fe-based" else 200.0 for one in controllers], m),
    }
    summaries = {one: result(errors, reachable, 50_000.0 if one == "fe-based" else 200.0) for one in controllers}
    spec = {"reached": 0.1, "fe_tolerance": 1e-3, "search": {"tolerance": 1e-5}}
    rows = ["tip.x", "tip.y", "tip.z", "tip.rx", "left", "top"]
    known = {"spec": spec, "plant": "fem", "nodes": 635, "fe_seconds": 0.06, "rows": rows}
    return Tracking(**{"columns": columns, "summaries": {"my-curve": summaries}, **known, **more})


def cells(table, column):
    return [row[table.head.index(column)] for row in table.rows]


def test_the_table_tells_times_in_milliseconds_and_counts_goals_that_the_robot_reached():
    table = tracking_table(tracking(errors=(0.01, 0.02, 0.2, np.nan)))
    assert cells(table, "time per step, median / p99") == ["50 / 100 ms", "200 / 400 µs"]
    assert cells(table, "goals reached") == ["2 of 4"] * 2 and cells(table, "goals not out of reach") == ["4"] * 2


def test_a_controller_without_reachable_goals_has_a_dash():
    found = tracking(reachable=(False,) * 4)
    found.summaries["my-curve"]["spectral"]["distance_to_fe_based"] = {"mean": 0.01, "max": 0.02}
    (fe, spectral) = tracking_table(found).rows
    assert spectral[-4:] == ("10 / 20 µm", "2", "200 / 400 µs", "1.0·10⁻¹²") and fe[-4] == "–"


def test_watched_points_are_those_with_an_x():
    assert places(tracking()) == [0]


@pytest.mark.parametrize("errors", [(0.0,) * 4, (0.1,) * 4, (np.nan,) * 4])
def test_exact_failed_and_ordinary_results_are_drawn_with_forces_and_pressures_apart(errors):
    section = tracking_section(tracking(errors), UNITS)
    assert [getattr(part, "name", None) for part in section.parts] == [None, "tracking-my-curve", "forces-my-curve"]
    text = "".join(section.parts[2].panels)
    assert len(section.parts[2].panels) == 2 and "force (mN)" in text and "pressure (kPa)" in text
    assert ">200<" in text  # 0.2 MPa


@pytest.mark.parametrize("robots", [1, 2])
def test_pushes_on_an_object_are_drawn(robots):
    found = tracking()
    found.columns["contact"] = np.ones((8, 3 * robots))
    found = tracking(columns=found.columns, rows=["tip.x", "tip.y", "tip.z", "tip.rx", "a.left", "b.top"])
    contact = tracking_section(found, UNITS).parts[-1]
    assert contact.name == "contact-my-curve" and ("a x" in contact.legend) == (robots == 2)
    assert contact.legend.count('stroke-dasharray="5 3"') == robots  # y of each robot, in the robot's own colour


def test_the_page_says_what_the_command_said_of_the_object():
    section = tracking_section(tracking(headline=["let go: the object stands on its table"]), UNITS)
    assert section.text.endswith("Let go: the object stands on its table. ")


def test_a_second_plane_is_drawn_only_of_curves_that_leave_the_first():
    curve = np.array([[0.0, 10.0 * i, i * i] for i in range(5)])
    assert planes(curve) == [(1, 2)]
    curve[2, 0] = 3.0
    assert planes(curve) == [(1, 2), (0, 1)]


def test_two_goals_are_not_drawn():
    assert len(tracking_section(tracking(errors=(0.1, 0.1), reachable=(True, True)), UNITS).parts) == 1


def test_effort_is_drawn_of_three_controllers_and_not_of_two():
    assert effort_charts(tracking()) == []
    (one,) = effort_charts(tracking(controllers=("fe-based", "spectral", "spectral@1")))
    assert "spectral, 1 step per goal" in one.legend


def test_the_looser_tolerance_is_explained_only_where_fe_based_control_is_worse():
    found = tracking()
    assert looser(found, "mm") == ""
    found.summaries["my-curve"]["fe-based"]["distance_to_reachable_goals"]["mean"] = 0.5
    assert "less than 0.001 mm" in looser(found, "mm") and "at 1e-05 mm" in looser(found, "mm")
    found.spec["search"]["tolerance"] = None
    assert "at 5e-05 % of their stroke" in looser(found, "mm")
    assert looser(tracking(controllers=("spectral",)), "mm") == ""


def first(found=None, **more):
    return tracking_summary(found or tracking(**more))


MESH = {"tip_mm": 0.03, "tip_percent": 0.025, "force_percent": 2.0, "reach_percent": 1.5, "states": 3}
MESH |= {"cells": 1000, "finer_cells": 2500}


def test_the_first_screen_has_three_numbers_with_their_units():
    found = first()
    assert found.concerns == () and "reaches 4 of 4 goals" in found.sentence
    assert [one.value for one in found.numbers] == ["4 of 4", "25 µm", "200 µs"]
    assert "60 ms, 300 times as long" in found.numbers[2].notes[0]
    assert found.numbers[1].notes == ("largest 40 µm, on the mesh of the model", "discretisation error: not estimated")
    assert first(plant="model").numbers[1].notes[0] == "largest 40 µm, by the model alone"


def test_the_discretisation_error_stands_beside_the_tracking_error():
    found = first(discretisation=MESH)
    assert (
        "discretisation error of the tip: up to 30 µm" in found.numbers[1].notes[1]
        and "uncertain" not in found.sentence
    )
    assert "leaves up to 0.3 mm uncertain at the tip" in first(discretisation={**MESH, "tip_mm": 0.3}).sentence
    assert "not estimated: too many cells" in first(discretisation={"left_out": "too many cells"}).numbers[1].notes[1]
    table = tracking_section(tracking(discretisation=MESH), UNITS).parts[1]
    assert table.rows == [("1000 cells against 2500", "3", "30 µm", "0.025", "2", "1.5")]


@pytest.mark.parametrize(
    "words, found",
    [
        ("misses 2 of the 4 goals", tracking(errors=(0.01, 0.02, 0.2, np.nan))),
        ("none of the 4 goals", tracking(reachable=(False,) * 4)),
    ],
)
def test_goals_that_are_missed_make_a_result_poor(words, found):
    assert words in first(found).concerns[0]


def test_goals_out_of_reach_are_no_failure_but_counted():
    found = first(tracking(errors=(0.01, 0.02, 9.0, 8.0), reachable=(True, True, False, False)))
    assert found.concerns == () and "2 goals lie out of its reach" in found.sentence
    assert found.numbers[0].value == "2 of 2" and found.numbers[1].value == "15 µm"


def test_where_no_fe_judges_plans_outside_the_training_are_poor():
    found = tracking(plant="model", fe_seconds=None)
    found.columns["inside"][:] = False
    assert "plans for 4 goals" in first(found).concerns[0]
    assert first(found).numbers[2].notes == ()


def test_a_coordinate_that_the_search_leaves_free_has_its_goals_where_the_robot_is():
    spec = {"reached": 0.1, "fe_tolerance": 1e-3, "search": {"tolerance": 1e-5, "weights": [0.0, 1.0, 0.0, 1.0]}}
    free, stated = (trajectory_charts(one, "my-curve", UNITS)[0] for one in (tracking(spec=spec), tracking()))
    assert "No goal states x or z" in free.caption and "No goal" not in stated.caption


def test_searches_that_did_not_converge_are_neither_in_reach_nor_out_of_it():
    found = tracking(errors=(0.01, 0.02, 5.0, 7.0))
    found.columns["verdict"][found.columns["error"] > 1] = "not converged"
    summary = first(found)
    assert "2 of 4 goals that are not shown to be out of reach" in summary.sentence
    assert "the search for 2 of 4 goals did not converge" in summary.concerns
