"""`loads:` of control.yaml and export.yaml: the model takes them, the FE robot carries them."""

import json

import numpy as np
import pytest
import yaml

import cfem
from cfem.constraint.patch import PatchLoad
from cfem.control.task.loads import load_doubts
from cfem.core.errors import InputError, SpecError
from cfem.predict.load import load_model
from cfem.predict.loads.loaded import loaded
from cfem.predict.loads.spec import LoadSpec, loads_of

LOADS = {"tip": {"force": {"N": [0.0, 0.02, -0.01]}}}
PAYLOAD = {"tip": {"mass": "2 g", "gravity": {"m/s^2": [0.0, 9.81, 0.0]}}}
PUSH = {"push": {"at": {"mm": [36, 0, 5]}, "radius": "6 mm", "force": {"N": [0.0, 0.02, -0.01]}}}


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


def test_a_force_on_a_patch_is_tracked(bar):
    """To the second order of the force, as finite elements at a few states, kept beside the model, tell it."""
    found = cfem.run_stage("control", control(bar, "pushed", loads=PUSH))
    assert results(found) < 0.002 and found["results"]["load_error"] < 0.01
    assert len(list((bar / "models" / "bar").glob("loads-*.npz"))) == 1


def test_c_is_python_under_forces_on_patches(bar):
    """Also the skin, of arrays; and control takes the export under the same loads alone."""
    loads = {**PUSH, **LOADS}
    more = {"formats": ["arrays", "c"], "shape": True, "loads": loads, "scene": "scene.yaml"}
    folder = exported(bar, "export-pushed", **more)
    parity = json.loads((folder / "model.json").read_text())["parity"]
    assert parity["arrays"] == 0.0 and parity["c"] < 1e-12 and parity["c shape"] < 1e-6
    model, trained = load_model(folder), load_model(bar / "models" / "bar" / "spectral")
    mine = loaded(trained, model.meta["wrench"], [PatchLoad(**one) for one in model.meta["patch_loads"]])
    for delta in ([0.5], [3.0]):
        apart = np.linalg.norm(model.at_displacement(delta).delta_e - mine.at_displacement(delta).delta_e)
        assert 1e-4 < apart < 0.1  # what finite elements add, as the export has named the scene
        assert np.allclose(model.shape(delta), mine.shape(delta), rtol=0, atol=1e-12)
    path = "../../models/bar/export-pushed"
    assert results(cfem.run_stage("control", control(bar, "again", model=path, loads=loads))) < 0.002
    said = r"exported under loads of 0, 0.02, -0.01 on .* and 0, 0.02, -0.01 N on 'push' at \(36, 0, 5\) mm, radius 6"
    with pytest.raises(InputError, match=said):
        cfem.run_stage("control", control(bar, "other", model=path, loads=LOADS))


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
        ({"a": {"at": {"mm": [36, 0, 5]}, "force": {"N": [0, 0, 1]}}}, "has both at and radius"),
        (
            {"a": {"at": {"mm": [36, 0, 15]}, "radius": "6 mm", "force": {"N": [0, 0, 1]}}},
            r"loads.a: .* 10 mm off the sur",
        ),
        ({"a": {"at": {"mm": [36, 0, 5]}, "radius": "1 mm", "force": {"N": [0, 0, 1]}}}, "loads.a: a radius of 1 mm"),
        ({"a": {"at": {"mm": [36, 0, 5]}, "radius": "6 mm", "gravity": {"m/s^2": [0, 0, 1]}}}, "no mass that gravity"),
    ],
)
def test_wrong_loads_get_one_sentence(bar, loads, said):
    with pytest.raises(SpecError, match=said):
        cfem.run_stage("control", control(bar, "wrong", loads=loads))


def test_a_load_that_the_model_cannot_take_names_the_model(bar):
    with pytest.raises(InputError, match=r"models/bar/spectral.*wrong by about"):
        cfem.run_stage("control", control(bar, "heavy", loads={"tip": {"force": {"N": [0, 1.0, 0]}}}))


def test_both_ways_of_stating_a_weight_agree():
    weight = LoadSpec.model_validate(PAYLOAD["tip"]).newtons()
    assert np.allclose(weight, [0, 2e-3 * 9.81, 0], rtol=1e-12)


def test_a_payload_may_hang_on_a_patch():
    place = {"at": {"mm": [50, 5, 0]}, "radius": "6 mm"}
    loads = {"stone": LoadSpec.model_validate(place | PAYLOAD["tip"]), "tip": LoadSpec.model_validate(LOADS["tip"])}
    forces, (stone,) = loads_of(loads, {})
    assert list(forces) == ["tip"]
    assert stone.same(PatchLoad([50, 5, 0], 6.0, [0, 2e-3 * 9.81, 0])) and stone.name == "stone"


def test_a_payload_whose_weight_is_in_another_unit_is_poor(bar):
    """9.81 mm/s^2: a thousandth of its weight. The run says so first."""
    weightless = {"tip": PAYLOAD["tip"] | {"gravity": {"mm/s^2": [0, 9.81, 0]}}}
    found = cfem.run_stage("control", control(bar, "weightless", loads=weightless))["results"]["judgement"]
    assert [each["what"] for each in found if "gravity" in each["what"]] == [
        "loads.tip.gravity is 0.00981 m/s^2, and on earth 9.81 m/s^2: check its unit"
    ]
    assert load_doubts({"tip": LoadSpec.model_validate(PAYLOAD["tip"])}) == []
