"""The examples and the notebooks run as they are, and print what the site shows."""

import re
import runpy
from pathlib import Path

import nbformat
import pytest
from support.script import script

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def executed():
    return script("notebooks").executed


def words(notebook):
    """What a notebook prints, without its numbers and paths."""
    printed = "".join(one.get("text", "") for cell in notebook.cells for one in cell.get("outputs", []))
    return re.sub(r"[-+]?\d[\d.e+-]*( (µs|ms|s|nm|µm|mm)\b)?", "#", re.sub(r"/\S*/", "", printed)).split()


@pytest.mark.slow
@pytest.mark.parametrize("path", sorted(ROOT.glob("docs/notebooks/*.ipynb")), ids=lambda path: path.stem)
def test_the_notebook_prints_what_the_site_shows(path, executed):
    assert words(executed(path)) == words(nbformat.read(path, as_version=4))


def test_the_examples_run_one_after_the_other(bar, monkeypatch, capsys):
    monkeypatch.chdir(bar)
    names = {path.stem for path in ROOT.glob("examples/*.py")}
    order = ["solve", "stages", "dataset", "ask_model", "workspace", "inverse", "control"]
    elsewhere = {
        "train_policy",
        "train_lift",
        "mujoco_lift",
        "mujoco_arm",
        "pressure_regulator",
    }  # tests/{gym, mujoco, plant}
    assert names == {*order, *elsewhere}
    for name in order:
        text = (ROOT / "examples" / f"{name}.py").read_text()
        assert len(text.split('"""', 2)[2].split("\n\n", 1)[1].splitlines()) <= 12
        runpy.run_path(str(ROOT / "examples" / f"{name}.py"))
    printed = capsys.readouterr().out
    assert "within the training states: True" in printed
    last = re.findall(r"tick 8: .* tip (\S+) mm from the goal", printed)
    assert float(last[0]) < 0.01
