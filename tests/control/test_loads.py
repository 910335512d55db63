"""`loads:` of control.yaml and export.yaml: the model takes them, the FE robot carries them."""

import json

import numpy as np
import pytest
import yaml

import cfem
from cfem.core.errors import InputError, SpecError
from cfem.predict.load import load_model

LOADS = {"tip": {"force": {"N": [0.0, 0.02, -0.01]}}}
PAYLOAD = {"tip": {"mass": "2 g", "gravity": {"m/s^2": [0.0, 9.81, 0.0]}}}


def control(bar, name, model="../../models/bar/spectral", **more):
    spec = {
        "scene": "scene.yaml",
        "mesh": "../../data/bar/mesh",
        "models": {"spectral": model},
        "out": f"../../data/bar/{name}",
        "trajectories": {"image": {"kind": "image", "centre": [0.4], "radii": [0.2], "goals": 4}},
        "mesh_error": None,
        **more,
    }
    path = bar / "pipelines" / "bar" / f"{name}.yaml"
    path.write_text(yaml.safe_dump(spec))
    return path


def results(manifest):
    """mm, mean distance from the goals, which count as reached within 0.1 mm."""
    found = manifest["results"]["trajectories"]["image"]["spectral"]
    assert found["reached"] == found["goals"] == 4
    return found["distance_to_reachable_goals"]["mean"]


def exported(bar, name, **more):
    path = bar / "pipelines" / "bar" / f"{name}.yaml"
    spec = {"model": "../../models/bar/spectral", "out": f"../../models/bar/{name}", "formats": ["arrays"], **more}
    path.write_text(yaml.safe_dump(spec))
    cfem.run_stage("export", path)
    return bar / "models" / "bar" / name


def test_the_loaded_robot_is_tracked_by_the_loaded_model(bar):
    """Without the load in the model the cable would be wrong: the goals are where the loaded FE robot goes."""
    with_it = cfem.run_stage("control", control(bar, "loaded", loads=PAYLOAD))
    assert results(with_it) < 0.05
    stated = with_it["results"]["load_error"]
    assert results(with_it) / 3 < stated < 0.1
    assert any("under the loads" in line for line in with_it["results"]["headline"])


def test_an_export_under_loads_is_the_loaded_model(bar):
    folder = exported(bar, "export-loaded", loads=LOADS)
    model, plain = load_model(folder), load_model(bar / "models" / "bar" / "spectral")
    assert model.meta["wrench"] == [0.0, 0.02, -0.01]
    assert json.loads((folder / "model.json").read_text())["parity"]["arrays"] == 0.0
    moved = model.at_displacement([2.0]).delta_e - plain.at_displacement([2.0]).delta_e
    assert moved[1] > 0.5
    again = cfem.run_stage("control", control(bar, "exported", model="../../models/bar/export-loaded", loads=LOADS))
    assert results(again) < 0.05


def test_a_loaded_model_needs_the_same_loads(bar):
    exported(bar, "export-loaded", loads=LOADS)
    path = control(bar, "other", model="../../models/bar/export-loaded")
    with pytest.raises(InputError, match=r"exported under loads of 0, 0.02, -0.01 .* the spec has 0, 0, 0"):
        cfem.run_stage("control", path)


@pytest.mark.parametrize(
    ("loads", "said"),
    [
        ({"tip": {"mass": "2 g"}}, "expected force, or gravity with or without mass"),
        ({"tip": {"force": {"N": [0, 0, 1]}, "mass": "2 g"}}, "expected force, or gravity with or without mass"),
        ({"tip": {"mass": "-2 g", "gravity": {"m/s^2": [0, 0, 1]}}}, "greater than 0"),
        ({"tip": {"gravity": {"m/s^2": [0, 0, 1]}}}, "no mass that gravity could act on"),
        ({"top": {"force": {"N": [0, 0, 1]}}}, "no effector 'top'"),
    ],
)
def test_wrong_loads_get_one_sentence(bar, loads, said):
    with pytest.raises(SpecError, match=said):
        cfem.run_stage("control", control(bar, "wrong", loads=loads))


def test_a_load_that_the_model_cannot_take_names_the_model(bar):
    with pytest.raises(InputError, match=r"models/bar/spectral.*wrong by about"):
        cfem.run_stage("control", control(bar, "heavy", loads={"tip": {"force": {"N": [0, 1.0, 0]}}}))


def test_both_ways_of_stating_a_weight_agree():
    from cfem.predict.load_spec import LoadSpec

    weight = LoadSpec.model_validate(PAYLOAD["tip"]).newtons()
    assert np.allclose(weight, [0, 2e-3 * 9.81, 0], rtol=1e-12)
