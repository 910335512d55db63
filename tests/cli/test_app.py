"""Commands as a user types them: exit codes, one sentence an error, outputs untouched."""

import json
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import jsonschema
import pytest
from typer.main import get_command
from typer.testing import CliRunner

from cfem.cli.app import app
from cfem.cli.schemas import schema_of
from cfem.core.artefact.judgement import poor
from cfem.core.kinds import KINDS
from cfem.core.yaml import read_yaml
from cfem.robot.stage import COMMAND

ROOT = Path(__file__).parents[2]
BAR = (ROOT / "pipelines" / "bar" / "scene.yaml").read_text()


@pytest.fixture
def bar(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text(BAR.replace("../../data/bar/mesh", "mesh"))
    return path


def cfem(*words):
    return CliRunner().invoke(app, [str(word) for word in words])


def test_mesh_then_up_to_date_then_inspect(bar):
    first = cfem("mesh", bar, "--quiet")
    assert first.exit_code == 0 and "volume 6000 mm^3" in first.stdout
    assert "up to date" in cfem("mesh", bar).stdout
    assert cfem("mesh", bar, "--check").exit_code == 0
    assert "set" not in cfem("mesh", bar, "--json").stderr
    assert json.loads(cfem("mesh", bar, "--json").stdout)["results"]["inverted"] == 0
    assert "made by cfem mesh" in cfem("inspect", bar.parent / "mesh").stdout


PLACED = ["--set", "actuators=[]", "--set", "effectors=[{name: tip, point: {mm: [59, 0, 0]}}]"]
OUTSIDE = "{kind: cable, name: c, points: {mm: [[15, 0, 40], [35, 0, 4]]}, reach: {mm: [0, 8]}}"
BAD = {
    "unknown key": (["--set", "mesh.sise=3 mm"], 2, "unknown key 'sise', did you mean 'size'?"),
    "wrong unit": (["--set", "mesh.size=3 kPa"], 2, "not a unit of length"),
    "bare number": (["--set", "mesh.size=3"], 2, "expected a length with its unit"),
    "incompressible": (["--set", "material.poisson=0.5"], 2, "0.4999"),
    "no direction": (["--set", "fixed.0.normal=[0, 0, 0]"], 2, "expected a direction"),
    "negative size": (["--set", "geometry.width=-3 mm"], 2, "greater than 0"),
    "point outside": (["--set", f"actuators.0={OUTSIDE}"], 2, "lies outside the body"),
    "no such file": (["--set", "geometry={kind: step, path: none.step}", *PLACED], 3, "no such file"),
}


@pytest.mark.parametrize("words, code, part", BAD.values(), ids=BAD.keys())
def test_bad_input_is_one_sentence_and_touches_nothing(bar, words, code, part):
    assert cfem("mesh", bar).exit_code == 0
    before = (bar.parent / "mesh" / "manifest.json").read_bytes()
    result = cfem("mesh", bar, "--quiet", *words)
    assert result.exit_code == code and result.stdout == ""
    assert len(result.stderr.strip().splitlines()) == 1 and part in result.stderr
    assert (bar.parent / "mesh" / "manifest.json").read_bytes() == before


def test_missing_spec_duplicate_key_and_stale_check(bar):
    assert cfem("mesh", bar.parent / "none.yaml").exit_code == 3
    assert cfem("mesh", bar, "--check").exit_code == 5
    bar.write_text(bar.read_text() + "name: again\n")
    result = cfem("mesh", bar)
    assert result.exit_code == 2 and f":{len(bar.read_text().splitlines())}" in result.stderr


def test_a_defect_of_ours_asks_to_be_reported(bar, monkeypatch):
    monkeypatch.setitem(vars(COMMAND), "work", lambda *_: 1 / 0)
    result = cfem("mesh", bar)
    assert result.exit_code == 1 and "please report" in result.stderr and "Traceback" not in result.stderr


def test_what_is_no_artefact_is_called_so(bar):
    for words in (["inspect", bar], ["summary", bar]):
        done = cfem(*words)
        assert done.exit_code == 3 and "scene.yaml: is a file, and an artefact is a folder" in done.stderr
    done = cfem("inspect", bar.parent)
    assert done.exit_code == 3 and "holds no manifest.json: no command of cfem made it" in done.stderr
    assert "is a folder (name the YAML file in it)" in cfem("mesh", bar.parent).stderr


def test_a_poor_result_is_said_first_and_fails_when_strict(bar, monkeypatch):
    monkeypatch.setitem(vars(COMMAND), "work", lambda *_: {"judgement": [poor("12 of 24 states failed")]})
    done = cfem("mesh", bar)
    assert done.exit_code == 0 and done.stdout.splitlines()[0] == "POOR: 12 of 24 states failed"
    strict = cfem("mesh", bar, "--strict")
    assert strict.exit_code == 4 and "up to date" in strict.stdout and "12 of 24" in strict.stderr
    for words in (["inspect"], ["summary"]):
        assert cfem(*words, bar.parent / "mesh").stdout.splitlines()[0] == "POOR: 12 of 24 states failed"


def test_interruption_is_130(bar, monkeypatch):
    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setitem(vars(COMMAND), "work", interrupt)
    assert cfem("mesh", bar).exit_code == 130


def test_help_lists_commands_and_exit_codes_without_the_heavy_imports():
    shown = cfem("--help").stdout
    assert all(name in shown for name in ("sample", "train", "report", "130  interrupted"))
    heavy = ("torch", "gmsh", "numba", "scipy", "pint", "pyarrow", "matplotlib")
    code = f"import sys, cfem.cli.app; print([m for m in {heavy} if m in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"


@pytest.mark.parametrize("command", sorted(get_command(app).commands))
def test_a_command_shows_its_arguments_in_capitals_and_no_names_of_python_types(command):
    shown = cfem(command, "--help").stdout
    assert f" {command} [OPTIONS]" in shown.splitlines()[0]
    assert not re.search(r"[<{]\w+", shown)


def test_committed_schemas_are_current():
    for kind in KINDS:
        assert (ROOT / "schemas" / f"{kind}.json").read_text() == schema_of(kind), f"run `cfem schema`: {kind}"


@pytest.mark.parametrize("path", sorted(ROOT.glob("pipelines/*/*.yaml")), ids=lambda p: f"{p.parent.name}/{p.stem}")
def test_every_pipeline_file_fits_its_schema(path):
    kind = path.stem.split("-")[0]
    assert kind in KINDS
    validator(kind).validate(read_yaml(path)[0])


@cache
def validator(kind):
    text = schema_of(kind)
    assert "prefixItems" not in text
    jsonschema.Draft7Validator.check_schema(json.loads(text))
    return jsonschema.Draft7Validator(json.loads(text))
