"""What a scene may say, and the sentence that each mistake gets."""

import json
import re

import jsonschema
import pytest
from robot.scenes import BASE, scene

from cfem.core.errors import SpecError
from cfem.core.spec import json_schema
from cfem.core.yaml import parse_yaml
from cfem.robot.spec import SceneSpec

CAVITY = "[{kind: cavity, name: air, inside: {mm: [15, 0, 0]}, reach: {ml: [0, 1]}}]"
FULL = BASE | {
    "geometry": "{kind: assembly, parts: [{name: a, geometry: {kind: bar}, size: 4 mm, refine: []}, "
    "{name: b, geometry: {kind: bar}, rotate: {axis: [0, 0, 1], angle: 180 deg}, translate: {cm: [9, 0, 0]}}]}",
    "mesh": "{size: 5 mm, element: hex8}",
    "material": "{law: mooney-rivlin, c10: 100 kPa, c01: 10 kPa, poisson: 0.49, density: 1070 kg/m^3}",
    "materials": "[{region: {kind: name, name: b}, material: {law: ogden, mu: {kPa: [300]}, alpha: [2], poisson: 0.4, "
    "density: 1 g/cm^3}}]",
    "rigid": "[{kind: plane, point: {mm: [60, 0, 0]}, normal: [1, 0, 0]}]",
    "gravity": "{acceleration: {m/s^2: [0, 0, -9.81]}}",
    "loads": "[{point: {mm: [30, 0, 0]}, force: {mN: [0, 0, -100]}, radius: 3 mm, body: a}]",
    "contacts": "[{name: touch, point: {mm: [20, 5, 0]}, body: a}]",
    "effectors": "[{name: tip, points: {mm: [[50, 0, 4], [50, 0, -4]]}, orientation: true, body: a}]",
}


def text(parts):
    return "".join(f"{key}: {value}\n" for key, value in parts.items())


def test_a_scene_with_everything_in_the_system_of_units(tmp_path):
    spec = scene(tmp_path, **FULL)
    assert spec.gravity.acceleration.tolist() == [0, 0, -9810] and spec.loads[0].force.tolist() == [0, 0, -0.1]
    assert spec.material.density == pytest.approx(1.07e-9, rel=1e-14)
    assert spec.geometry.parts[1].translate.tolist() == [90, 0, 0]
    assert scene(tmp_path, actuators=CAVITY).actuators[0].reach.tolist() == [0, 1000]


@pytest.mark.parametrize("parts", [BASE, FULL, BASE | {"actuators": CAVITY}])
def test_editors_and_the_program_accept_the_same(parts):
    schema = json_schema(SceneSpec)
    assert "prefixItems" not in json.dumps(schema)
    jsonschema.Draft7Validator(schema).validate(parse_yaml(text(parts), "scene.yaml")[0])


@pytest.mark.parametrize(
    "changes, part",
    [
        (
            {"gravity": FULL["gravity"]},
            "material: gravity needs the density of each material, such as '1070 kg/m^3'",
        ),
        (
            {**FULL, "materials": FULL["materials"].replace("density: 1 g/cm^3", "")},
            "materials.0.material: gravity needs the density",
        ),
        ({"material": "{young: 1 MPa, poisson: 0.3, density: 1070}"}, "density with its unit, such as '1 kg/m^3'"),
        ({"loads": "[{point: {mm: [1, 0, 0]}, force: [0, 0, 1]}]"}, "numbers under their unit, such as {N: [...]}"),
        (
            {"actuators": CAVITY.replace("inside: {mm: [15, 0, 0]}, ", "")},
            "cavity 'air': give one of inside and surface",
        ),
        ({"actuators": CAVITY.replace("inside", "surface: s, inside")}, "got inside and surface both"),
        (
            {"actuators": CAVITY.replace("[0, 1]", "[1, 0]")},
            "cavity 'air': reach must be two numbers, the smaller first",
        ),
        ({"material": {"young": "3000 kpa", "poisson": 0.45}}, "'kpa' is not a unit of stress; did you mean kPa?"),
        ({"actuators": CAVITY.replace("ml", "mm")}, "'mm' is not a unit of volume; expected e.g. mm^3"),
        (
            {"actuators": CAVITY.replace("cavity", "cavty")},
            "expected one of cable, push, cavity, chambers; got 'cavty', did you mean",
        ),
        ({"effectors": "[{name: tip}]"}, "effector 'tip': give one of point, points and at, got none"),
        (
            {"contacts": "[{name: tip, point: {mm: [20, 5, 0]}}]"},
            "contacts.0.name: names must differ, and effectors.0.name is 'tip' too",
        ),
        ({"mesh": "{size: 5 mm, element: hex20}"}, "'hex8'"),
        ({**FULL, "mesh": "{size: 5 mm, refine: [{corners: {mm: [[0, 0, 0], [1, 1, 1]]}, size: 1 mm}]}"}, "each part"),
        ({"geometry": FULL["geometry"].replace("name: b", "name: a")}, "names of parts must differ, got ['a', 'a']"),
        ({"geometry": FULL["geometry"].replace("[0, 0, 1]", "[0, 0, 0]")}, "expected a direction, not (0, 0, 0)"),
        ({"geometry": "{kind: assembly, parts: [{name: a, geometry: {kind: assembly, parts: []}}]}"}, "got 'assembly'"),
    ],
)
def test_each_mistake_is_named(tmp_path, changes, part):
    with pytest.raises(SpecError, match=re.escape(part)):
        scene(tmp_path, **changes)


@pytest.mark.parametrize("key", ["actuators", "effectors", "contacts"])
@pytest.mark.parametrize("name", ['a\\"; system(\\"x\\"); //', "two\\nlines", "", "é", "a b", "x" * 101])
def test_names_are_of_letters_that_any_file_and_language_takes(tmp_path, key, name):
    """They become names of columns and text in the generated C."""
    parts = BASE | {"contacts": FULL["contacts"].replace(", body: a", "")}
    first = re.search(r"name: [a-z]+", parts[key])[0]
    with pytest.raises(SpecError, match=rf"{key}\.0(\.\w+)?\.name: a name has letters"):
        scene(tmp_path, **(parts | {key: parts[key].replace(first, f'name: "{name}"')}))


@pytest.mark.parametrize(
    "actuator, why",
    [
        ("{kind: cable, name: c, points: {mm: [[5, 0, 0], [25, 0, 0]]}, reach: {mm: [-5, -1]}}", "it only pulls"),
        (
            "{kind: cavity, name: c, inside: {mm: [15, 0, 0]}, reach: {ml: [-2, -1]}, unilateral: true}",
            "it only pushes",
        ),
        (
            "{kind: cavity, name: c, inside: {mm: [15, 0, 0]}, reach: {ml: [0, 1]}, pressure: {kPa: [-2, -1]}, "
            "unilateral: true}",
            "its pressure must end above 0; got -0.002 to -0.001",
        ),
    ],
)
def test_an_actuator_of_one_direction_reaches_that_way(tmp_path, actuator, why):
    with pytest.raises(SpecError, match=rf"'c': .*{why}"):
        scene(tmp_path, actuators=f"[{actuator}]")


@pytest.mark.parametrize(
    "keys, said",
    [
        ("chambers: [0], reach: {mm: [0, 5]}", r"actuators\.0\.reach: 'mm' is not a unit of volume"),
        ("chambers: [12], reach: {mm^3: [0, 5]}", r"actuators\.0\.chambers\.0: must be at most"),
        ("chambers: [0], raech: {mm^3: [0, 5]}", r"actuators\.0\.raech: unknown key 'raech', did you mean 'reach'"),
    ],
)
def test_a_kind_that_is_also_the_name_of_a_key_leads_nobody_to_that_key(tmp_path, keys, said):
    with pytest.raises(SpecError, match=said):
        scene(tmp_path, actuators=f"[{{kind: chambers, name: pair, module: 1, {keys}}}]")


def test_a_name_that_is_none_is_told_in_words(tmp_path):
    with pytest.raises(SpecError, match=r"name: expected small letters \(a to z\), digits and hyphens, got 'Größe'"):
        scene(tmp_path, name="Größe")
