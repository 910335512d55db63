"""Estimates against the truth, in rows that are counted by hand."""

import numpy as np
import pytest

from cfem.control.closed_loop.estimated_account import estimate_results, estimate_sentence

NAN = np.nan


def row(of=1, status="converged", a=1.0, true=1.1, sd=0.1, load=0.2, load_true=0.0, unseen="", **more):
    return {
        "estimate_of": of,
        "estimate_status": status,
        "estimated_a": [a],
        "true_a": [true],
        "estimated_a_sd": [sd],
        "loads": [load],
        "true_loads": [load_true],
        "loads_sd": [0.05],
        "shape_rms": 0.2,
        "shape_max": 0.5,
        "unseen": unseen,
        "left_out": 1,
        "innovation": 6.0,
        "innovation_numbers": 4,
    } | more


def test_errors_and_intervals_are_those_of_new_estimates_that_converged():
    rows = [
        row(),
        row(of=0, a=99.0, left_out=100),  # none is new
        row(of=2, status="iterations", a=99.0),
        row(of=3, a=1.5, shape_rms=0.4, shape_max=0.7, unseen="push", innovation=2.0),
        row(of=4, true=NAN, load_true=NAN, shape_rms=NAN, shape_max=NAN, innovation_numbers=0),
    ]
    found = estimate_results(rows, ("cable", "push"))
    assert (found["samples"], found["estimated"], found["left_out"]) == (4, 3, 3)
    assert found["shape"] == {"median": pytest.approx(0.3), "max": 0.4, "point": 0.7}
    cable, push = found["unknowns"]["cable"], found["unknowns"]["push"]
    assert cable["rms"] == pytest.approx(np.sqrt((0.01 + 0.16) / 2)) and cable["sd"] == pytest.approx(0.1)
    assert (cable["covered"], cable["numbers"], cable["observed"]) == (0.5, 2, 2)
    assert (push["covered"], push["numbers"], push["observed"]) == (0.0, 2, 1)
    assert push["rms"] == pytest.approx(0.2)
    assert found["covered"] == 0.25 and found["observed"] == 0.75
    assert found["covered_observed"] == pytest.approx(1 / 3)
    assert found["innovation"] == pytest.approx(1.0)
    text = estimate_sentence(found)
    assert text.startswith(
        "estimate: 3 of 4 samples estimated, shape to 0.3 mm rms, 0.4 at most, 95 % intervals hold in"
    )
    assert "hold in 25.0 %, 33.3 % of the 75 % that is observed, innovations 1.00 of what is stated" in text


def test_without_truth_only_what_was_estimated_is_said():
    found = estimate_results([row(status="iterations")], ())
    assert found == {"samples": 1, "estimated": 0, "innovation": None, "unknowns": {}, "left_out": 0}
    assert estimate_sentence(found) == "estimate: 0 of 1 samples estimated"
    hidden = estimate_results([row(unseen="cable push")], ("cable", "push"))
    assert hidden["covered_observed"] is None and "observed" not in estimate_sentence(hidden).replace("unobserved", "")
