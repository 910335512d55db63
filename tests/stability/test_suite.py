"""Running cases whatever they do, and the command as a user types it."""

import json
import warnings
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from cfem.cli.app import app
from cfem.core.errors import NumericalError, SpecError
from cfem.equilibrium.system.solution import Status
from cfem.stability.case import Case, converges, named, refuses
from cfem.stability.evidence import Evidence
from cfem.stability.suite import built_in, demand_right, run
from cfem.stability.table import as_data, as_text


class Fake:
    """A trial that shows what it is told to."""

    def __init__(self, **figures):
        self.found = Evidence(**{"status": "CONVERGED", "claimed": True, **figures})

    def evidence(self):
        return self.found


class Unseen:
    def evidence(self):
        raise IndexError("nothing there")


class Panic(BaseException):
    """As compiled libraries raise them."""


def raises(error):
    def work():
        raise error

    return work


def warns():
    warnings.warn("invalid value", RuntimeWarning, stacklevel=1)
    return Fake()


RIGHT = Case("good/one", converges(), lambda: Fake(condition=np.inf))
CASES = {
    "right": (RIGHT, None),
    "refused": (Case("a", refuses(SpecError, "so"), raises(SpecError("not so"))), None),
    "traceback": (Case("a", converges(), raises(ValueError("oh"))), "ValueError: oh"),
    "panic": (Case("a", named("SINGULAR"), raises(Panic("oh"))), "Panic: oh"),
    "accepted": (Case("a", refuses(SpecError, "so"), lambda: Fake()), "went on to CONVERGED"),
    "made something else": (Case("a", refuses(SpecError, "so"), lambda: 3), "made int"),
    "warning": (Case("a", converges(), warns), "invalid value"),
    "cannot be examined": (Case("a", converges(), Unseen), "IndexError: nothing there"),
    "also": (Case("a", converges(also=lambda trial: "it is bent"), lambda: Fake()), "it is bent"),
}


@pytest.mark.parametrize("case, word", CASES.values(), ids=CASES.keys())
def test_whatever_happens_is_judged(case, word):
    wrong = run(case).wrong
    assert wrong == () if word is None else word in wrong[0]


def test_an_interruption_is_no_case():
    with pytest.raises(KeyboardInterrupt):
        run(Case("a", converges(), raises(KeyboardInterrupt())))


def test_results_are_shown_and_misbehaviour_is_an_error():
    good, bad = run(RIGHT), run(CASES["traceback"][0])
    text = as_text([good, bad])
    assert text.startswith("good ") and "\n  one " in text and "wrong: converges was due, not ValueError: oh" in text
    assert "2 cases, 1 as they should be, 1 misbehave" in text
    data = as_data([good, bad])
    assert data["misbehaving"] == ["a"] and data["table"][0]["condition"] is None
    json.dumps(data, allow_nan=False)
    demand_right([good])
    with pytest.raises(NumericalError, match="1 of 2 cases misbehave: a"):
        demand_right([good, bad])


def cfem(*words):
    return CliRunner().invoke(app, ["stability", *words])


def test_the_command_lists_chooses_and_prints_one_object():
    names = cfem("--list").stdout.split("\n")
    assert "cables/coincident points" in names and "large/1e5 linear tetrahedra" not in names
    found = cfem("--only", "faults/* cavity*/hex8", "--json")
    assert found.exit_code == 0 and json.loads(found.stdout)["cases"] == 1
    assert cfem("--only", "cables/coincident points", "--quiet").exit_code == 0
    assert cfem("--only", "none such").exit_code == 2
    assert cfem("none.yaml").exit_code == 3


def test_a_misbehaving_case_is_exit_4_after_the_table(monkeypatch):
    monkeypatch.setattr("cfem.stability.suite.built_in", lambda: [RIGHT, CASES["traceback"][0]])
    found = cfem("--quiet")
    assert found.exit_code == 4 and found.stdout.startswith("good ")
    assert found.stderr == "cfem: 1 of 2 cases misbehave: a (the table says how)\n"
    assert json.loads(cfem("--json").stdout)["misbehaving"] == ["a"]


def test_every_line_of_the_table_fits_80_columns():
    longest = max(built_in(), key=lambda case: len(case.name.partition("/")[2]))
    status = max(Status, key=lambda one: len(one.name)).name
    result = run(RIGHT)
    text = as_text([replace(result, case=longest, evidence=replace(result.evidence, status=status))])
    assert max(map(len, text.splitlines())) <= 80 and longest.name.partition("/")[2] in text
