"""The page in which the reader moves the robot, beside the report that links it."""

import re

import pytest
from pydantic import ValidationError

import cfem
from cfem.core.artefact.manifest import read_manifest
from cfem.core.errors import InputError
from cfem.core.stage import Options
from cfem.report.sections.interactive import page_of
from cfem.report.spec import ReportSpec
from cfem.report.stage import run

WHOLE = {"scene": "s.yaml", "mesh": "m", "samples": "d", "models": {"spectral": "m"}, "control": "c", "out": "o"}


@pytest.fixture(scope="module")
def specs(bar):
    """The bar's, with a run of control and a page."""
    specs = bar / "pipelines" / "bar"
    cfem.run_stage("export", specs / "export.yaml")
    cfem.run_stage("export", specs / "export-page.yaml")
    asked = ["trajectories.swing.goals=3", "fe_based=false", "mesh_error=null"]
    cfem.run_stage("control", specs / "control.yaml", overrides=asked)
    return specs


def test_the_report_links_the_page_that_lies_beside_it(specs):
    manifest = run(specs / "report.yaml", ["page=../../models/bar/page"], None, Options(quiet=True))
    folder = specs.parents[1] / "data" / "bar" / "report"
    text = (folder / "report.html").read_text()
    links = re.findall(r'<a href="([^"#]+)">', text)
    assert links == ["robot.html"] == [manifest["results"]["moved"]]
    exported = specs.parents[1] / "models" / "bar" / "page" / "page.html"
    assert (folder / "robot.html").read_bytes() == exported.read_bytes()
    assert manifest["files"]["robot.html"] and f"({exported.stat().st_size / 1e3:.0f} kB)" in text
    assert len(text) < 600_000  # the page is not inside


def test_a_report_without_a_page_links_none(specs, tmp_path):
    run(specs / "report.yaml", [], tmp_path / "report", Options(quiet=True))
    assert "robot.html" not in (tmp_path / "report" / "report.html").read_text()
    assert not (tmp_path / "report" / "robot.html").exists()


def test_a_folder_that_holds_no_page_says_what_makes_one(specs):
    folder = specs.parents[1] / "models" / "bar" / "spectral-export"
    with pytest.raises(InputError, match="no page of the robot") as error:
        page_of(folder, read_manifest(folder))
    assert "formats: [html]" in error.value.do


def test_a_page_belongs_to_a_robot():
    ReportSpec.model_validate({**WHOLE, "page": "p"})
    with pytest.raises(ValidationError, match="page: it is linked beside the robot: give scene, mesh"):
        ReportSpec.model_validate({"loops": {"a": "b"}, "page": "p", "out": "o"})
