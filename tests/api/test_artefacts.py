import numpy as np
import pytest

import cfem


def test_a_stage_is_run_once(bar):
    again = cfem.run_stage("mesh", str(bar / "pipelines" / "bar" / "scene.yaml"))
    assert again["status"] == "up to date" and again["results"]["nodes"] > 0


def test_an_unknown_stage_names_those_that_there_are(bar):
    with pytest.raises(cfem.SpecError, match="'meshing' is no stage"):
        cfem.run_stage("meshing", bar / "pipelines" / "bar" / "scene.yaml")


def test_a_stale_output_is_an_error_where_only_a_check_was_asked(bar):
    with pytest.raises(cfem.GateError, match="stale"):
        cfem.run_stage("mesh", bar / "pipelines" / "bar" / "scene.yaml", overrides=["length=50 mm"], check=True)


def test_a_folder_runs_the_stages_that_are_stale(bar):
    done = cfem.run_folder(bar / "pipelines" / "bar", until="train")
    assert [one["status"] for one in done["results"]["stages"]] == 3 * ["up to date"]
    with pytest.raises(cfem.GateError, match="2 of 3 stages are stale"):
        cfem.run_folder(bar / "pipelines" / "bar", until="train", overrides=["sample.skeleton=5"], check=True)


def test_a_dataset_is_read_from_its_folder_or_its_file(bar):
    folder = bar / "data" / "bar" / "samples"
    assert len(cfem.read_dataset(folder)) == 16 and len(cfem.read_dataset(folder, "test")) == 8
    np.testing.assert_array_equal(cfem.read_dataset(folder / "test.parquet").W, cfem.read_dataset(folder, "test").W)


def test_a_model_is_asked_by_displacement_or_by_force(bar):
    model = cfem.load_model(str(bar / "models" / "bar" / "spectral"))
    state = model.at_displacement([3.0])
    np.testing.assert_allclose(model.at_force(state.lambda_a).delta_a, [3.0], rtol=1e-8)
    assert model.inside(state)


def test_what_is_no_artefact_is_an_input_error(tmp_path):
    for read in (cfem.read_dataset, cfem.load_model):
        with pytest.raises(cfem.InputError):
            read(tmp_path)
