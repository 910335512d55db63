"""What `make regenerate` compares: a difference is seen, named and measured; rounding is none."""

import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from support.script import script
from surrogate.stored import store_dataset

ROOT = Path(__file__).parents[1]
regenerate = script("regenerate")


@pytest.fixture
def gold(tmp_path):
    """Of a synthetic dataset, and its folder."""
    samples = store_dataset(tmp_path / "samples")
    found = regenerate.gold(samples)
    (tmp_path / "robot.json").write_text(json.dumps(found))
    return found, samples


def changed(tmp_path, found, factor):
    found["test"]["columns"]["W"]["gold"][1][3] *= factor
    (tmp_path / "robot.json").write_text(json.dumps(found))


def test_the_same_dataset_and_rounding_are_no_difference(gold, tmp_path):
    found, samples = gold
    assert regenerate.compare("robot", samples, tmp_path) == ([], [])
    changed(tmp_path, found, 1 + 1e-9)
    assert regenerate.compare("robot", samples, tmp_path) == ([], [])
    assert regenerate.table([], True) == []


def test_a_changed_number_is_named_with_its_size(gold, tmp_path):
    found, samples = gold
    committed = found["test"]["columns"]["W"]["gold"][1][3]
    changed(tmp_path, found, 1.001)
    notes, (off,) = regenerate.compare("robot", samples, tmp_path)
    assert notes == [] and off[:5] == ("robot/test", "W", "gold", found["test"]["ids"][1], "tip.x x cable0")
    assert off.committed == pytest.approx(1.001 * committed) and off.found == committed
    assert off.off == pytest.approx(
        abs(off.committed - off.found) / np.abs(found["test"]["columns"]["W"]["gold"]).max()
    )
    found["train"]["rows"] += 1
    found["train"]["columns"]["energy"]["mean"][0] = float("nan")
    (tmp_path / "robot.json").write_text(json.dumps(found))
    notes, off = regenerate.compare("robot", samples, tmp_path)
    assert notes == ["robot/train rows: 41 -> 40"] and [one.column for one in off] == ["W", "energy"]


def test_a_person_reads_the_worst_number_of_each_column_or_all():
    off = [
        regenerate.Difference("bar/test", "W", "gold", 7, "tip.x x cable", 1.0, 1.1, 0.1),
        regenerate.Difference("bar/test", "W", "mean", 7, "tip.x x cable", 1.0, float("nan"), float("nan")),
        regenerate.Difference("bar/test", "energy", "gold", 7, "", 2.0, 2.5, 0.25),
    ]
    _, W, energy, says = regenerate.table(off, each=False)
    assert W.split() == ["bar/test", "W", "tip.x", "x", "cable", "mean", "1", "nan", "nan", "2"]
    assert energy.split() == ["bar/test", "energy", "row", "7", "2", "2.5", "2.5e-01", "1"]
    assert says.startswith("3 numbers differ") and len(regenerate.table(off, each=True)) == 5


def test_a_missing_split_is_said(gold, tmp_path):
    found, samples = gold
    (tmp_path / "robot.json").write_text(json.dumps(found | {"third": found["test"]}))
    assert regenerate.compare("robot", samples, tmp_path) == (["robot/third: missing"], [])


def test_what_another_code_made_is_stale(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "data" / "bar").mkdir(parents=True)
    (tmp_path / "src" / "cfem").mkdir(parents=True)
    module = tmp_path / "src" / "cfem" / "law.py"
    module.write_text("constant = 1\n")
    (tmp_path / "constraints.txt").write_text("")
    calls = []

    def run(words, **options):
        calls.append(words[1:])
        return subprocess.CompletedProcess(words, 0, "", "")

    monkeypatch.setattr(regenerate.subprocess, "run", run)

    def made(check):
        calls.clear()
        return regenerate.make("bar", check), sum("--force" in words for words in calls)

    assert made(check=True) == (5, 0)  # nobody knows which code made it
    assert made(check=False) == (0, 2)
    assert made(check=True) == made(check=False) == (0, 0)
    module.write_text("constant = 2\n")
    assert made(check=True) == (5, 0)
    assert made(check=False) == (0, 2)


def test_gold_is_committed_for_every_scene_of_the_command():
    for scene in regenerate.SCENES:
        found = json.loads((ROOT / regenerate.GOLD / f"{scene}.json").read_text())
        assert set(found) == {"train", "test"} and found["test"]["failed"] == 0
        assert all(
            np.isfinite(column["gold"]).all() for split in found.values() for column in split["columns"].values()
        )
    assert shutil.which("make") is None or "regenerate:" in (ROOT / "Makefile").read_text()
