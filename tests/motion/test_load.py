"""Model folders that move: written by training, read back, told by `cfem modes`."""

import shutil

import numpy as np
import pytest

from cfem.cli.modes import as_text, modes
from cfem.core.artefact.manifest import read_manifest
from cfem.core.errors import InputError, SpecError
from cfem.core.stage import Options
from cfem.export.stage import run as export
from cfem.motion.load import load_motion
from cfem.motion.modes import natural_modes
from cfem.predict.load import read_model
from cfem.report.stage import run as report


@pytest.fixture
def folder(root):
    return root / "models" / "bar" / "spectral"


def test_training_writes_what_a_model_needs_to_move(folder):
    assert (folder / "motion.npz").exists() and "motion.npz" in read_manifest(folder)["files"]
    model = load_motion(folder)
    found = natural_modes(model, np.array([2.0]))
    assert (np.diff(found.frequency) > 0).all() and (found.damping > 0).all()


def test_modes_are_told_along_the_workspace(folder, tmp_path):
    results = modes(folder, picture=tmp_path / "modes.png")
    assert len(results["states"]) == 5 and (tmp_path / "modes.png").stat().st_size > 1000
    assert all(len(row["frequency"]) == 3 for row in results["states"])
    assert "Hz" in as_text(results)
    one = modes(folder, ["2.0"], free=True, count=2)
    assert one["states"][0]["delta_a"] == [2.0] and one["actuators"] == "free"
    with pytest.raises(SpecError, match="--at"):
        modes(folder, ["2.0, 1.0"])


def test_the_report_shows_how_it_vibrates(root, folder):
    spec = root / "pipelines" / "bar" / "report.yaml"
    spec.write_text("moving: {bar: ../../models/bar/spectral}\nout: ../../data/bar/vibrations\n")
    out = report(spec, [], None, Options(quiet=True))["results"]
    page = (root / "data" / "bar" / "vibrations" / out["page"]).read_text()
    assert "How it vibrates" in page and "held: Hz (damping)" in page and "vibrations-bar-1.svg" in out["pictures"]


def test_an_export_moves_as_the_model_does(root, folder):
    export(root / "pipelines" / "bar" / "export.yaml", ["formats=[arrays, c]"], None, Options(quiet=True))
    exported = load_motion(root / "models" / "bar" / "spectral-export")
    delta = np.array([2.0])
    np.testing.assert_array_equal(exported.at(delta).M, load_motion(folder).at(delta).M)
    assert (root / "models" / "bar" / "spectral-export" / "c" / "cfem_motion_data.c").exists()


def test_a_model_that_cannot_move_says_so(folder, tmp_path):
    still = shutil.copytree(folder, tmp_path / "still")
    (still / "motion.npz").unlink()
    with pytest.raises(InputError, match="has not learned to move"):
        load_motion(still)


@pytest.mark.parametrize(
    ("meta", "said"),
    [
        ({}, "model.json says nothing of its motion \\('motion'\\)"),
        ({"motion": None}, "model.json says nothing of its motion"),
        ({"motion": {"viscosity": "damaged"}}, "damaged"),
    ],
)
def test_a_model_whose_card_does_not_go_with_its_motion_says_so(folder, monkeypatch, meta, said):
    known, arrays = read_model(folder)
    known = {key: value for key, value in known.items() if key != "motion"} | meta
    monkeypatch.setattr("cfem.motion.load.read_model", lambda folder: (known, arrays))

    def refused(static, arrays, viscosity):
        raise InputError(viscosity)

    monkeypatch.setattr("cfem.motion.load.MotionModel", refused)
    with pytest.raises(InputError, match=said) as caught:
        load_motion(folder)
    assert "motion.npz" in str(caught.value) and "train it again" in str(caught.value)
