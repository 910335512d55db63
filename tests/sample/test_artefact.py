"""What the manifest of a dataset says of its rows."""

import json

import numpy as np
import pyarrow as pa
import pytest

from cfem.core.errors import NumericalError
from cfem.sample.artefact import results


def rows(failed, solved=24):
    n = failed + solved
    return pa.table(
        {
            "status": ["step-too-small"] * failed + ["converged"] * solved,
            "reason": ["stopped at 60 % of the way"] * failed + [""] * solved,
            "residual": [1e-3] * failed + [1e-12] * solved,
            "seconds": [1.0] * n,
            "factorizations": [2] * n,
            "iterations": [2] * n,
            "steps": [1] * n,
            "id": list(range(n)),
            "split": ["train"] * n,
            "u": [[0.5, 0.25]] * n,
        }
    )


def test_more_than_one_failed_row_in_twenty_is_judged():
    assert results({"train": rows(1), "test": rows(1)})["judgement"] == []
    (judged,) = results({"train": rows(12, 12), "test": rows(0)})["judgement"]
    assert judged["what"].startswith("12 of 48 states failed, 25 %")
    assert "stopped at 60 % of the way" in judged["what"]


def test_a_split_without_any_converged_row_is_no_dataset():
    with pytest.raises(NumericalError, match="no row of 'test' converged: stopped at 60 %"):
        results({"train": rows(0), "test": rows(3, 0)})


def test_a_state_that_took_many_times_the_mean_is_named_with_what_it_took():
    table = rows(0)
    said = results({"train": table, "test": rows(0)})["headline"]
    assert not any("dearest" in line for line in said)
    table = table.set_column(4, "factorizations", pa.array([2] * 7 + [44] + [2] * 16))
    table = table.set_column(6, "steps", pa.array([1] * 7 + [6] + [1] * 16))
    (line,) = (line for line in results({"train": table, "test": rows(0)})["headline"] if "dearest" in line)
    assert line == "dearest state: row 7 of train, u = [0.50, 0.25], 44 factorisations in 6 load steps; converged"


def test_pulls_that_were_drawn_back_are_said():
    table = rows(0).replace_schema_metadata({"cfem": '{"together": 0.595}'})
    (line,) = (line for line in results({"train": table})["headline"] if "at once" in line)
    assert line.startswith("all actuators at once are pulled to 60 % of their reach")


def test_states_that_fill_little_of_a_reach_are_judged():
    """A chamber from -4500 to 3000 mm^3 that pulls alone leave above 0."""
    facts = {
        "rows": {"effectors": [], "actuators": ["chamber"], "contacts": [], "skin": []},
        "row_units": [["mm^3", "MPa"]],
        "reach": [[-4500.0, 3000.0]],
    }
    told = {}
    for low in (0.0, -4000.0):
        grown = pa.array([[float(value)] for value in np.linspace(low, 2900.0, 24)], pa.list_(pa.float64(), 1))
        table = rows(0).append_column("delta_a", grown)
        judged = results({"train": table.replace_schema_metadata({"cfem": json.dumps(facts)})})["judgement"]
        told[low] = " ".join(sentence["what"] for sentence in judged)
    assert told[-4000.0] == ""
    assert told[0.0].startswith("states of 'chamber' lie between 0 and 2.9e+03 mm^3, 39 % of its reach: draw from all")
