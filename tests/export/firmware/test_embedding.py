"""What a scene says of the robot that a C controller is for."""

from pathlib import Path

import numpy as np
import pytest
from export.embedded import needs_compiler, spectral, states

from cfem.condensed.parameters import Parameter, to_json
from cfem.core.errors import InputError
from cfem.core.spec import load_spec
from cfem.export.compiled.controller import CompiledController
from cfem.export.firmware.embedding import Embedding, embedding, stated_pressures, write_embedded
from cfem.export.spec import CSpec
from cfem.robot.spec import SceneSpec

PIPELINES = Path(__file__).parents[3] / "pipelines"
LENGTH = Parameter("L", "geometry.segment_length", "mm", 38.0, 42.0, 40.0)
FINGER = {"rows": {"actuators": ["cable"]}, "rest_e": [0.0, 10.5, -120.0], "parameters": to_json([LENGTH])}


def scene(name: str) -> SceneSpec:
    return load_spec(PIPELINES / name / "scene.yaml", SceneSpec)


def test_pressures_are_the_scene_s():
    expected = np.tile([0.0, 0.2], (6, 1))
    names = [f"{module}-{i}" for module in ("base", "top") for i in (1, 2, 3)]
    assert (stated_pressures(scene("stiff-flop"), names) == expected).all()
    with pytest.raises(InputError, match="actuators are base-1"):
        stated_pressures(scene("stiff-flop"), names[:3])
    assert stated_pressures(scene("soft-finger"), ["left", "right"]) is None


def test_a_design_rests_where_its_own_tip_is():
    robot = embedding(FINGER, CSpec(parameters={"L": "41 mm"}), scene("parametric-finger"))
    assert robot.pressures is None and robot.rest_e == pytest.approx([0, 10.5, -123])
    assert embedding(FINGER, CSpec(), None).rest_e is None
    with pytest.raises(InputError, match="name its scene"):
        embedding(FINGER, CSpec(parameters={"L": "41 mm"}), None)


@needs_compiler
def test_the_code_of_one_robot_of_many_is_the_model_there(tmp_path):
    meta, arrays = spectral("displacement", 2, True)
    spec = CSpec(parameters={"poisson": 0.44, "young": "2 MPa"})
    rest = np.array([1.0, 2.0, 3.0])
    report = write_embedded(
        tmp_path, spec, meta, arrays, states("displacement", 2, 20, parameters=True), Embedding(rest_e=rest)
    )
    assert report["parity"] < 1e-13
    assert "cfem_rest_e[3] = {1.0, 2.0, 3.0}" in (tmp_path / "cfem_data.c").read_text().replace("\n", " ")
    assert CompiledController(tmp_path).model(np.zeros(2))["status"] == 0
