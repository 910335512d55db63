"""The sentence on bounds that held."""

from types import SimpleNamespace

import pytest
from control.loop_poles import integral_bound

from cfem.control.closed_loop.run import Pace
from cfem.control.closed_loop.runs import unstable
from cfem.control.closed_loop.summary import _saturated, headline, judged, summarise
from cfem.plant.gains import Gains


def test_bounds_are_told_by_kind_and_rare_ones_left_to_the_table():
    shares = {"base-1: smallest": 0.005, "base-3: smallest": 0.167, "top-2: smallest": 0.0583, "top-2: rate": 1.0}
    assert _saturated(shares | {"bounds on the robot missed": 0.002}) == [
        "smallest command of base-3 in 16.7 %, top-2 in 5.83 % of the ticks",
        "largest change of top-2 in 100 % of the ticks",
        "bounds on the robot missed in 0.2 % of the ticks",
    ]
    assert _saturated({"base-1: smallest": 0.005}) == []


def test_a_trajectory_is_poor_where_the_best_controller_misses_most_goals():
    def of(reached):
        return {"reached": {"mean": reached}, "goals": 10}

    assert judged({"curve": {"open": of(0.0), "closed": of(5.0)}}) == []
    (one,) = judged({"curve": {"open": of(0.0), "closed": of(4.9)}, "other": {"open": of(10.0)}})
    assert one["what"] == "curve: the best controller, closed, reaches 4.9 of 10 goals"


def moments(errors_of_goals):
    """A run with these errors, mm, at the ticks of each goal."""
    actual = SimpleNamespace(status="converged")
    return [
        SimpleNamespace(index=index, error=error, cpu=1e-6, actual=actual)
        for index, errors in enumerate(errors_of_goals)
        for error in errors
    ]


@pytest.mark.parametrize(
    ("errors", "run_up", "mean", "at_goals"),
    [
        ([[9.0, 8.0], [1.0, 2.0], [3.0, 4.0]], 0, 2.5, 14 / 3),  # on its way to the first goal it does not count
        ([[9.0, 8.0], [1.0, 2.0]], 0, 1.5, 5.0),
        ([[9.0, 8.0]], 0, 8.5, 8.0),  # of one goal there is nothing else
        ([[9.0, 8.0], [7.0, 6.0], [3.0, 4.0]], 2, 3.5, 4.0),
    ],
)
def test_errors_of_goals_by_the_clock_leave_the_way_to_the_first_out(errors, run_up, mean, at_goals):
    found = summarise([moments(errors)], len(errors), Pace(0.1, 1, ticks_a_goal=2, run_up=run_up), 10.0)
    assert found["error"]["mean"] == pytest.approx(mean)
    assert found["error_at_goals"]["mean"] == pytest.approx(at_goals)
    assert found["goals"] == len(errors) - run_up and found["ticks_to_converge"] is None


def test_a_sentence_has_what_a_controller_did_and_no_more():
    row = {
        "error_at_goals": {"mean": 0.25, "max": 1.5}, "ticks_to_converge": {"held": 3, "median": 4.5, "max": 9},
        "reached": {"mean": 2.5}, "goals": 3, "seconds": 1.25, "step_us": {"median": 12.0}, "no_position": 4,
    }  # fmt: skip
    (line,) = headline({"curve": {"closed": row}})
    said = line.split("; ")
    assert said[0] == "curve, closed: 2.5 of 3 goals reached in 1.25 s"
    assert said[1] == "after 4.5 ticks each, 9 at most"
    assert said[2].startswith("tracking error mean ") and said[2].endswith(" when the next was due")
    assert said[3].endswith("of CPU time per tick") and said[3].startswith("12 ")
    assert said[4] == "the plant gave NO POSITION in 4 ticks" and len(said) == 5
    for wait in (None, {"held": 0, "median": None, "max": None}):
        bare = row | {"error_at_goals": None, "ticks_to_converge": wait, "no_position": 0}
        assert [len(each.split("; ")) for each in headline({"a": {"b": bare, "c": bare}})] == [2, 2]


@pytest.mark.parametrize("late", [0, 1, 3])
def test_a_stated_gain_beyond_the_bound_of_late_samples_is_called_unstable(late):
    controller, bound = SimpleNamespace(feedback=SimpleNamespace(late=late)), integral_bound(late)
    for harmless in (None, Gains(), Gains(integral=0.99 * bound), Gains(proportional=0.1, integral=2 * bound)):
        assert unstable(harmless, controller) == {}
    found = unstable(Gains(integral=1.01 * bound), controller)
    assert found["unstable"]["stable_below"] == pytest.approx(bound)
    moment = {"reached": {"mean": 0}, "goals": 1, "seconds": 1.0, "error_at_goals": None, "ticks_to_converge": None}
    row = moment | {"step_us": {"median": 1.0}, "no_position": 0} | found
    assert f"is UNSTABLE: stable below {bound:.2g} where samples come {late} late" in headline({"a": {"b": row}})[0]
