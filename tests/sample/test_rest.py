"""Where designs rest, from the scene, against the geometry's own formula."""

from pathlib import Path

import numpy as np
import pytest
from parametric.synthetic import POISSON
from robot.scenes import scene

from cfem.core.spec import load_spec
from cfem.robot.spec import SceneSpec
from cfem.sample.parameters import scene_parameters
from cfem.sample.rest import Rest
from cfem.sample.spec import ParameterSpec

FINGER = Path(__file__).parents[2] / "pipelines" / "parametric-finger" / "scene.yaml"
L = ParameterSpec(key="geometry.segment_length", range={"mm": [38, 42]})
H = ParameterSpec(key="geometry.height", range={"mm": [20, 22]})


def test_the_tip_of_the_finger_follows_its_length_and_height():
    parameters = scene_parameters({"L": L, "H": H}, FINGER)
    rest = Rest(load_spec(FINGER, SceneSpec), parameters, np.zeros(3))
    found = rest(np.array([[38.0, 20.0], [41.3, 21.7]]))
    assert found == pytest.approx(np.array([[0, 10.0, -114.0], [0, 10.85, -123.9]]))


def test_materials_move_no_rest_position(tmp_path):
    rest = Rest(scene(tmp_path), (POISSON,), np.array([1.0, 2.0, 3.0]))
    assert np.array_equal(rest(np.array([[0.4], [0.45]])), [[1, 2, 3], [1, 2, 3]])
