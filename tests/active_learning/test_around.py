"""States added where a task goes: on finite elements of the bar, whose model knew too little there."""

import json

import numpy as np
import pyarrow.parquet as pq
import pytest

import cfem
from cfem.core.artefact.manifest import read_manifest
from cfem.dataset.writer import write_columns


@pytest.fixture(scope="module")
def known(bar, tmp_path_factory):
    """A dataset of pulls up to a third of the reach, and a run of control that goes to four fifths of it."""
    folder, specs = tmp_path_factory.mktemp("around"), bar / "pipelines" / "bar"
    text = (specs / "sample.yaml").read_text().replace("../../data/bar/mesh", str(bar / "data" / "bar" / "mesh"))
    text = text.replace("scene: scene.yaml", f"scene: {specs / 'scene.yaml'}").replace("../../data/bar/samples", "base")
    (folder / "sample.yaml").write_text(text)
    few = ["splits={train: {rows: 8, method: scrambled-halton, seed: 1}, test: {rows: 3, method: random, seed: 2}}"]
    cfem.run_stage("sample", folder / "sample.yaml", overrides=few, workers=1)
    task = folder / "task"
    task.mkdir()
    states = np.concatenate([np.linspace(6.0, 9.5, 60), [np.nan]])[:, None]
    write_columns(task / "loop.parquet", {"delta_a": states}, {})
    (task / "manifest.json").write_text(
        json.dumps({"stage": "control", "content": "x", "made_from": "x", "files": {}, "inputs": {}, "source": None,
                    "results": {}, "precious": False, "origin": None, "versions": {}, "seconds": 0.0})
    )  # fmt: skip
    around = [*few, f"around={{task: {task}, add: 5, judges: 4}}"]
    return folder, around, cfem.run_stage("sample", folder / "sample.yaml", overrides=around, workers=1)


def test_states_are_added_where_the_task_goes_and_the_error_falls(known):
    folder, _, manifest = known
    found = manifest["results"]["around"]
    assert found["added"] == 5 and found["judges"] == 4 and found["samples"] == 13
    assert found["after"] < 0.1 * found["before"] and "states added" in manifest["results"]["headline"][0]
    before, after = (
        {split: pq.read_table(folder / name / f"{split}.parquet") for split in ("train", "test")}
        for name in ("base", "base-around")
    )
    for split, more in (("train", 5), ("test", 4)):
        assert after[split].slice(0, len(before[split])).equals(before[split])
        new = after[split].slice(len(before[split]))
        assert len(new) == more and set(new["status"].to_pylist()) == {"converged"}
        assert all(5.9 < one[0] < 9.6 for one in new["delta_a"].to_pylist())
        assert len(set(after[split]["id"].to_pylist())) == len(after[split])
    assert (folder / "base-around" / "skin.npz").read_bytes() == (folder / "base" / "skin.npz").read_bytes()


def test_a_model_of_them_is_trained_and_the_dataset_is_current(known, bar):
    folder, around, _ = known
    train = bar / "pipelines" / "bar" / "train.yaml"
    dataset = [f"dataset={folder / 'base-around'}"]
    results = cfem.run_stage("train", train, overrides=dataset, out=folder / "model")["results"]
    assert results["samples"] == 13
    assert len(cfem.load_model(folder / "model").skin) > 0
    again = cfem.run_stage("sample", folder / "sample.yaml", overrides=around, workers=1)
    assert again["status"] == "up to date"
    assert read_manifest(folder / "base-around")["inputs"].keys() == {"mesh", "base"}


def test_a_task_that_runs_again_leaves_the_dataset_and_its_models_current(known, bar):
    folder, around, _ = known
    (folder / "task" / "manifest.json").write_text("{}")
    dataset = [f"dataset={folder / 'base-around'}"]
    train = bar / "pipelines" / "bar" / "train.yaml"
    assert cfem.run_stage("train", train, overrides=dataset, out=folder / "again")["status"] == "done"
    assert cfem.run_stage("sample", folder / "sample.yaml", overrides=around)["status"] == "up to date"


@pytest.mark.parametrize(
    ("override", "said"),
    [
        ("around={task: .}", "neither loop.parquet"),
        ("until.error=1 mm", "around does not go with"),
        ("around.add=0", "must be at least 1"),
    ],
)
def test_a_wrong_spec_gets_one_sentence(known, tmp_path, override, said):
    folder, around, _ = known
    with pytest.raises(cfem.CfemError, match=said):
        cfem.run_stage("sample", folder / "sample.yaml", overrides=[*around, override], out=tmp_path / "out", workers=1)
