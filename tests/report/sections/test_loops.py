import numpy as np
import pytest

from cfem.report.sections.estimates import estimate_table
from cfem.report.sections.loops import loop_chart, loop_table
from cfem.report.sections.summary import loops_summary


def result(reached=4, held=True):
    return {
        "reached": {"mean": reached},
        "goals": 4,
        "seconds": 5.3,
        "ticks_to_converge": {"median": 4, "max": 7} if held else {"median": None, "max": None},
        "error_at_goals": {"mean": 0.05, "max": 0.08},
        "error": {"mean": 1.0, "max": 30.0},
        "step_us": {"median": 840.0, "p99": 12_000.0},
    }


def test_the_table_tells_lengths_and_times_with_their_units():
    good, bad = loop_table({"curve": {"tuned": result(), "open": result(0, held=False)}}).rows
    assert good == ("curve", "tuned", "4 of 4", "5.3", "4 / 7", "50 / 80 µm", "1 / 30 mm", "0.84 / 12 ms")
    assert bad[2] == "0 of 4" and bad[4] == "–"


@pytest.mark.parametrize("error", [0.0, 0.1, np.nan])
def test_a_loop_is_drawn_whatever_its_errors(error):
    goals = np.array([[0.0, 10.0 * i, -120 + i * i] for i in range(4)])
    rows = {
        "controller": np.repeat(["open", "tuned"], 4),
        "goal_index": np.tile(np.arange(4), 2),
        "goal": np.tile(goals, (2, 1)),
        "x_e": np.tile(goals, (2, 1)),
        "error": np.full(8, error),
        "seed": np.zeros(8, int),
        "seconds": np.tile(np.arange(4) / 90, 2),
    }
    assert len(loop_chart("loop", rows, "curve").panels) == 2


def test_a_run_is_summed_up_by_its_best_controller():
    found = loops_summary({"points": {"curve": {"open": result(0), "tuned": result()}}})
    assert [one.value for one in found.numbers] == ["4 of 4", "50 µm", "840 µs"] and not found.concerns


def test_several_runs_name_those_where_goals_are_missed():
    found = loops_summary({"good": {"curve": {"tuned": result()}}, "bad": {"curve": {"open": result(3)}}})
    assert (
        found.concerns[0] == ("in bad no controller reaches all goals; the best, open, reaches 3 of 4")
        and found.numbers == ()
    )


def test_of_controllers_that_reach_all_goals_the_nearest_is_the_best():
    far = result() | {"error_at_goals": {"mean": 0.4, "max": 0.5}}
    near = result() | {"error_at_goals": {"mean": 0.01, "max": 0.5}}
    found = loops_summary({"points": {"curve": {"policy": far, "closed": near}}})
    assert found.sentence.startswith("Controller closed")


def test_the_table_of_estimates_has_intervals_and_innovations():
    found = {"samples": 9, "estimated": 8, "covered": 0.99, "covered_observed": 0.95, "innovation": 0.98}
    found |= {"left_out": 3, "unknowns": {"tip.y": {"rms": 0.01, "sd": 0.02}}}
    blind = {"samples": 9, "estimated": 8, "covered": 0.5, "covered_observed": None, "innovation": None}
    blind |= {"left_out": 0, "unknowns": {}}
    table = estimate_table({"line": {"one": {"estimate": found}, "other": {"estimate": blind}}}, ["tip.y"])
    assert table.rows == [
        ("line", "one", "8 of 9", "10 / 20", "99.0 % / 95.0 %", "0.98", "3"),
        ("line", "other", "8 of 9", "", "50.0 % / –", "–", "0"),
    ]
