"""The sentence on bounds that held."""

from cfem.control.closed_loop_summary import _saturated


def test_bounds_are_told_by_kind_and_rare_ones_left_to_the_table():
    shares = {"base-1: smallest": 0.005, "base-3: smallest": 0.167, "top-2: smallest": 0.0583, "top-2: rate": 1.0}
    assert _saturated(shares | {"bounds on the robot missed": 0.002}) == [
        "smallest command of base-3 in 16.7 %, top-2 in 5.83 % of the ticks",
        "largest change of top-2 in 100 % of the ticks",
        "bounds on the robot missed in 0.2 % of the ticks",
    ]
    assert _saturated({"base-1: smallest": 0.005}) == []
