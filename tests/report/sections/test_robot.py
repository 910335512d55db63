"""The facts of a robot, in words."""

from pathlib import Path

import pytest
from support.blocks import block

from cfem.core.spec import load_spec
from cfem.report.sections.robot import facts
from cfem.robot.materials import MaterialRegion
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


def test_each_other_material_says_which_part_is_of_it():
    scene = load_spec(PIPELINES / "bar" / "scene.yaml", SceneSpec)
    box = {"kind": "box", "corners": {"mm": [[20, -5, -5], [40, 5, 0]]}}
    ball = {"kind": "sphere", "centre": {"mm": [50, 0, 0]}, "radius": "3 mm"}
    pad = {"kind": "name", "name": "solid-2"}
    regions = [
        {"region": region, "material": {"young": f"{young} MPa", "poisson": 0.3}}
        for region, young in ((box, 20), (ball, 3), (pad, 7))
    ]
    materials = [MaterialRegion.model_validate(region) for region in regions]
    scene = scene.model_copy(update={"materials": materials})
    words = facts(scene, block((2, 1, 1), (2, 1, 1)), 4)["other materials"].split("; ")
    assert [part.split(":")[0] for part in words] == [
        "box from (20, -5, -5) to (40, 5, 0) mm",
        "ball of 3 mm about (50, 0, 0) mm",
        "solid-2",
    ]
    assert [f"Young's modulus {young} MPa" in part for part, young in zip(words, (20, 3, 7), strict=True)] == [True] * 3
