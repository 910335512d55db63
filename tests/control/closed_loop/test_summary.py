"""The sentence on bounds that held."""

from cfem.control.closed_loop.summary import _saturated, judged


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
