"""What `make regenerate` compares: a difference is seen, named and measured; rounding is none."""

import importlib.util
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from surrogate.stored import store_dataset

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def script():
    spec = importlib.util.spec_from_file_location("regenerate", ROOT / "scripts" / "regenerate.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def gold(script, tmp_path):
    """Of a synthetic dataset, and its folder."""
    samples = store_dataset(tmp_path / "samples")
    found = script.gold(samples)
    (tmp_path / "robot.json").write_text(json.dumps(found))
    return found, samples


def changed(tmp_path, found, factor):
    found["test"]["columns"]["W"]["gold"][1][3] *= factor
    (tmp_path / "robot.json").write_text(json.dumps(found))


def test_the_same_dataset_and_rounding_are_no_difference(script, gold, tmp_path):
    found, samples = gold
    assert script.compare("robot", samples, tmp_path) == []
    changed(tmp_path, found, 1 + 1e-9)
    assert script.compare("robot", samples, tmp_path) == []


def test_a_changed_number_is_named_with_its_size(script, gold, tmp_path):
    found, samples = gold
    changed(tmp_path, found, 1.001)
    (line,) = script.compare("robot", samples, tmp_path)
    assert line.startswith("robot/test W gold[1, 3]: ") and "of the column's size, allowed 1e-06" in line
    found["train"]["rows"] += 1
    found["train"]["columns"]["energy"]["mean"][0] = float("nan")
    (tmp_path / "robot.json").write_text(json.dumps(found))
    assert len(script.compare("robot", samples, tmp_path)) == 3


def test_a_missing_split_is_said(script, gold, tmp_path):
    found, samples = gold
    (tmp_path / "robot.json").write_text(json.dumps(found | {"third": found["test"]}))
    assert script.compare("robot", samples, tmp_path) == ["robot/third: missing"]


def test_gold_is_committed_for_every_scene_of_the_command(script):
    for scene in script.SCENES:
        found = json.loads((ROOT / script.GOLD / f"{scene}.json").read_text())
        assert set(found) == {"train", "test"} and found["test"]["failed"] == 0
        assert all(
            np.isfinite(column["gold"]).all() for split in found.values() for column in split["columns"].values()
        )
    assert shutil.which("make") is None or "regenerate:" in (ROOT / "Makefile").read_text()
