"""The loop stops when the model knows the robot, says so truly, resumes, and leaves the test states alone."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from sample.synthetic import Factory
from surrogate.synthetic import POISSON, YOUNG

from cfem.active_learning import until_error as active
from cfem.dataset.reader import as_dataset
from cfem.dataset.writer import content_hash
from cfem.sample.spec import SampleSpec

SPEC = {
    "scene": "scene.yaml",
    "mesh": "mesh",
    "out": "out",
    "splits": {
        "train": {"rows": 300, "method": "scrambled-halton", "seed": 1},
        "test": {"rows": 30, "method": "random", "seed": 2},
    },
    "skeleton": 6,
    "until": {"error": "0.01 mm", "first": 10, "batch": 6, "largest": 80},
}


FEW = SPEC["until"] | {"largest": 40}


def explore(folder, factory=None, **changes):
    spec = SampleSpec(**{**SPEC, **changes})
    with ThreadPoolExecutor(1) as executor:
        tables, rounds = active.explore(spec, factory or Factory(), folder, executor, "")
    return tables, rounds, active.verdict(spec.until, tables, rounds)


@pytest.fixture(scope="module")
def explored(tmp_path_factory):
    return explore(tmp_path_factory.mktemp("explored"))


def test_it_stops_at_the_error_asked_for_and_the_test_states_agree(explored):
    tables, rounds, found = explored
    assert found["reached"] and found["samples"] < 80
    assert found["test_error"] <= 1e-2
    assert [one.observed <= 1e-2 for one in rounds[-2:]] == [True, True]
    assert found["samples"] == 10 + sum(one.rows for one in rounds)
    assert rounds[0].observed > rounds[-1].observed
    assert len(tables["test"]) == 30


@pytest.mark.slow
def test_a_smaller_error_takes_more_states(explored, tmp_path):
    _, _, smaller = explore(tmp_path, until={**SPEC["until"], "error": "1e-3 mm"})
    assert explored[2]["samples"] < smaller["samples"]


def test_what_is_not_reached_is_said(tmp_path):
    _, _, found = explore(tmp_path, until={**SPEC["until"], "error": "1e-9 mm", "largest": 24})
    assert not found["reached"] and found["samples"] == 24
    assert "NOT reached" in active.headline(found)[0]


def test_interrupted_it_goes_on_to_the_same_dataset(explored, tmp_path, monkeypatch):
    whole = content_hash(explored[0])
    original, calls = active.next_batch, []

    def once(*arguments):
        calls.append(1)
        if len(calls) == 2:
            raise KeyboardInterrupt
        return original(*arguments)

    monkeypatch.setattr(active, "next_batch", once)
    with pytest.raises(KeyboardInterrupt):
        explore(tmp_path / "parts")
    solved = {path: path.stat().st_mtime_ns for path in (tmp_path / "parts").rglob("*.parquet")}
    assert solved
    monkeypatch.setattr(active, "next_batch", original)
    assert content_hash(explore(tmp_path / "parts")[0]) == whole
    assert {path: path.stat().st_mtime_ns for path in solved} == solved  # nothing was solved twice


def test_test_states_choose_nothing(tmp_path):
    other = {**SPEC["splits"], "test": {"rows": 30, "method": "random", "seed": 9}}
    ids = [
        set(as_dataset(explore(tmp_path / str(i), splits=splits, skeleton=1, until=FEW)[0]["train"]).id.tolist())
        for i, splits in enumerate((SPEC["splits"], other))
    ]
    assert ids[0] == ids[1]


@pytest.mark.slow
def test_parameters_and_forces_too(tmp_path):
    factory = replace(Factory(), parameters=(POISSON, YOUNG), third_order=True)
    until = {**SPEC["until"], "error": "0.1 mm", "first": 30, "batch": 30, "form": "force", "largest": 120}
    tables, _, found = explore(tmp_path, factory, until=until)
    assert found["reached"] and found["test_error"] < 0.2
    assert np.ptp(as_dataset(tables["train"]).p) > 0.1


def test_failed_states_are_no_reason_to_stop(tmp_path):
    tables, rounds, found = explore(tmp_path, Factory(fails_beyond=15.0), until=FEW)
    assert any(status != "converged" for status in tables["train"]["status"].to_pylist())
    assert found["samples"] > 10 and all(np.isfinite(one.expected) for one in rounds)
