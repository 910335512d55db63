"""The error of the mesh from the samples to what a model's user reads."""

import json
import shutil

import numpy as np
import pytest

import cfem
from cfem.core.errors import SpecError
from cfem.core.spec import load_spec
from cfem.export.page.page import about
from cfem.robot.mesh import accuracy, grading
from cfem.sample.spec import SampleSpec


@pytest.fixture(scope="module")
def stating(bar, tmp_path_factory):
    """Manifest of samples of the bar with the error of its mesh, and the model of them."""
    project = tmp_path_factory.mktemp("stating")
    for name in ("pipelines", "data"):
        shutil.copytree(bar / name, project / name)
    specs = project / "pipelines" / "bar"
    sampled = cfem.run_stage("sample", specs / "sample.yaml", overrides=["mesh_error={states: 1}"], workers=1)
    assert sampled["results"]["kept"] == 24  # all of them: none was solved again
    cfem.run_stage("train", specs / "train.yaml")
    return sampled, project / "models" / "bar" / "spectral"


def test_samples_that_are_there_models_and_searches_state_the_same_error(stating, model):
    sampled, folder = stating
    error = sampled["results"]["mesh_error"]
    assert error["states"] == 1 and error["finer_cells"] == 8 * error["cells"] and error["factorizations"] > 2
    assert any(
        "discretisation error: where the effectors travel farthest" in line for line in sampled["results"]["headline"]
    )
    assert json.loads((folder / "model.json").read_text())["mesh_error"]["tip"] == error["tip"]
    trained = json.loads((folder / "manifest.json").read_text())["results"]["headline"]
    assert any(line.startswith("the mesh of the samples adds") for line in trained)
    stated = cfem.load_model(folder)
    found = cfem.find_actuation(stated, stated.rest_e + stated.at_displacement([4.0]).delta_e)
    assert found.mesh_error == stated.mesh_error.tip.bounds(np.linalg.norm(found.delta_e))
    assert 0 < found.mesh_error[0] < found.mesh_error[1] < 0.1 * np.linalg.norm(found.delta_e)
    own = f"off in {model.model_error.percent} of the unseen states of its domain"
    assert own in about(model.meta, model)
    assert "Its mesh adds" in about(stated.meta, stated) and "Its mesh adds" not in about(model.meta, model)
    assert cfem.find_actuation(model, model.rest_e).mesh_error is None


def test_the_content_of_samples_tells_whether_they_state_it(stating, bar):
    sampled, _ = stating
    before = json.loads((bar / "data" / "bar" / "samples" / "manifest.json").read_text())
    assert sampled["content"] != before["content"]


def test_it_does_not_go_with_rest(bar):
    with pytest.raises(SpecError, match="mesh_error does not go with"):
        load_spec(bar / "pipelines" / "bar" / "sample.yaml", SampleSpec, ["mesh_error={}", "space=rest"])


def test_samples_state_the_error_by_which_their_mesh_was_made(bar, tmp_path, monkeypatch):
    monkeypatch.setattr(accuracy, "FIRST", 60)
    monkeypatch.setattr(grading, "PASSES", 1)
    specs = shutil.copytree(bar / "pipelines" / "bar", tmp_path / "pipelines" / "bar")
    scene = specs / "scene.yaml"
    scene.write_text(scene.read_text().replace("5 mm, element: hex8", "20 mm, element: tet4, accuracy: 90 %"))
    made = cfem.run_stage("mesh", scene)["results"]["mesh_error"]
    rows = ["splits.train.rows=2", "splits.test.rows=1", "skeleton=2", "skin=null"]
    sampled = cfem.run_stage("sample", specs / "sample.yaml", overrides=rows, workers=1)["results"]
    assert sampled["mesh_error"] == made and 0 < made["tip"]["far"][1] < 0.9
    assert any("discretisation error" in line for line in sampled["headline"])
