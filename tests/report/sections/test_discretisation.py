"""The study of meshes, on the bar: facts that must hold of any robot."""

import json
from pathlib import Path

import pytest

from cfem.core.errors import SpecError
from cfem.core.spec import load_spec
from cfem.core.stage import Options
from cfem.report.sections.discretisation import orders
from cfem.report.spec import ReportSpec
from cfem.report.stage import run

BAR = Path(__file__).parents[3] / "pipelines" / "bar" / "scene.yaml"
SPEC = f"""
scene: {BAR}
out: report
discretisation:
  cases:
    - {{element: tet4, size: 6 mm}}
    - {{element: tet10p0, size: 8 mm}}
    - {{element: tet10p0, cells: 300}}
    - {{element: tet10p0, cells: 300, radius: 0 mm}}
    - {{element: hex8, size: 5 mm}}
  reference: {{element: tet10p0, cells: 700}}
  poisson: [0.3, 0.499]
  tolerances: [1e-2, 1e-8]
  states: [[0.6]]
"""


def study(folder, *overrides):
    (folder / "report.yaml").write_text(SPEC)
    run(folder / "report.yaml", overrides, None, Options(quiet=True))
    return folder / "report", json.loads((folder / "report" / "results.json").read_text())["discretisation"]


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Of as few meshes as a chart needs, and one material."""
    cases = [f"{{element: {element}, size: {size} mm}}" for element, size in (("tet4", 6), ("hex8", 5), ("tet10p0", 8))]
    few = f"discretisation.cases=[{', '.join(cases)}]", "discretisation.poisson=[0.3]"
    return study(tmp_path_factory.mktemp("study"), *few)


@pytest.mark.slow
def test_errors_are_those_of_the_element(tmp_path):
    _, found = study(tmp_path)
    at = {
        (row["element"], row["graded"], row["radius"], row["poisson"]): row
        for row in found["meshes"]
        if not row["reference"]
    }
    locked, free = at["tet4", False, None, 0.499], at["tet10p0", True, None, 0.499]
    assert locked["W"] > 0.3 > 0.05 > free["W"] > 0
    assert at["hex8", False, None, 0.3]["W"] < 0.1
    # a point gives way more than a region
    assert at["tet10p0", True, 0.0, 0.3]["W_11"] > 1.02 * at["tet10p0", True, None, 0.3]["W_11"]
    reference = [row for row in found["meshes"] if row["reference"]]
    assert len(reference) == 2 and all(row["W"] == 0 and row["front"] for row in reference)


def test_tolerance_bounds_the_error(results):
    _, found = results
    loose, tight = found["tolerances"]
    assert tight["residual"] < 1e-8 and tight["W"] < 1e-7
    assert loose["iterations"] <= tight["iterations"]


def test_the_page_shows_the_front(results):
    folder, _ = results
    page = (folder / "report.html").read_text()
    assert "on the front" in page and "<td>reference</td>" in page and "<td>0</td>" not in page
    assert (folder / "discretisation-1.svg").stat().st_size > 5_000


def test_the_order_of_convergence_is_a_slope():
    base = {"poisson": 0.3, "element": "tet4", "graded": False, "radius": None, "reference": False}
    rows = [{**base, "cells": n, "W": 7.0 * n ** (-2 / 3)} for n in (100, 800, 6400)]
    assert orders(rows)[0]["order"] == pytest.approx(2.0)
    assert orders(rows[:2]) == []


def test_a_page_on_nothing_or_on_half_of_a_model_is_refused(tmp_path):
    path = tmp_path / "report.yaml"
    for text, words in (
        ("scene: s.yaml\nout: o\n", "nothing to report"),
        ("scene: s.yaml\nout: o\ncontrol: c\n", "lacks"),
        (
            "scene: s.yaml\nout: o\ndiscretisation: {cases: [{element: tet4}], reference: {element: tet4, size: 1 mm},"
            " states: [[1]]}\n",
            "either a size or a number of cells",
        ),
    ):
        path.write_text(text)
        with pytest.raises(SpecError, match=words):
            load_spec(path, ReportSpec)
