"""Benchmarks are compared with those of the last release."""

import json
from pathlib import Path

import pytest
from support.script import script

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def bench():
    return script("bench")


def run(reference, **medians):
    named = {"test_reference.py::test_reference": reference, **medians}
    return {"benchmarks": [{"fullname": f"benchmarks/{k}", "stats": {"median": v}} for k, v in named.items()]}


def test_a_slower_machine_changes_nothing_and_slower_code_is_named(bench):
    before = bench.multiples(run(1.0, one=2.0, two=3.0))
    assert bench.multiples(run(5.0, one=10.0, two=15.0)) == before == {"one": 2.0, "two": 3.0}
    lines, slower = bench.compare(bench.multiples(run(1.0, one=2.2, two=7.8, three=1.0)), before)
    assert slower == ["two"]
    assert "2.60x" in lines[-1] and "new" in lines[2]


def test_the_last_release_is_there(bench):
    release = json.loads(bench.RELEASE.read_text())
    assert release["release"] and all(value > 0 for value in release["multiples"].values())
