"""The facts of a robot, in words."""

from pathlib import Path

import pytest
from support.blocks import block

from cfem.core.spec import load_spec
from cfem.report.sections.robot import facts
from cfem.robot.spec import SceneSpec

PIPELINES = Path(__file__).parents[3] / "pipelines"


@pytest.mark.parametrize(
    "robot, expected",
    [
        ("pneunet", {"layers": "0.1 mm thick, Young's modulus 6.5 GPa", "self-contact": "walls that face each other"}),
        ("mckibben", {"layers": "0.2 mm thick, fibres of 500 MPa, fibres of 500 MPa"}),
        ("bar", {}),
    ],
)
def test_layers_and_self_contact_are_among_them_where_there_are_any(robot, expected):
    scene = load_spec(PIPELINES / robot / "scene.yaml", SceneSpec)
    words = facts(scene, block((2, 1, 1), (2, 1, 1)), 4)
    assert {"layers", "self-contact"} & set(words) == set(expected)
    assert all(words[key].startswith(text) for key, text in expected.items())
    assert words["held"] == "4 of 12 nodes" and "Young's modulus" in words["material"]


@pytest.mark.parametrize(
    "robot, expected",
    [("fin-ray", "object: push, 0 to 12 mm"), ("mckibben", "chamber: cavity, 0 to 6000 mm³"), ("trunk", "mm")],
)
def test_the_reach_of_an_actuator_has_its_unit(robot, expected):
    scene = load_spec(PIPELINES / robot / "scene.yaml", SceneSpec)
    words = facts(scene, block((2, 1, 1), (2, 1, 1)), 4)["actuators"]
    assert words.endswith(expected)
