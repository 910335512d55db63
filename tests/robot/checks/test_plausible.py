"""What hardly can be meant is judged, with the numbers in the sentence."""

import numpy as np
import pytest
from robot.scenes import scene

from cfem.core.errors import InputError, SpecError
from cfem.core.stage import Options
from cfem.robot.build import build_robot
from cfem.robot.checks.plausible import doubts, size_doubts
from cfem.robot.mesh.meshing import make_mesh
from cfem.robot.stage import run


def test_sizes_that_suggest_another_unit():
    assert size_doubts(np.array([120.0, 20, 20])) == []
    assert (
        "0.06 x 0.01 x 0.01 mm, which suggests metres read as millimetres"
        in size_doubts(np.array([0.06, 0.01, 0.01]))[0]
    )
    assert (
        "6e+04 x 1e+04 x 1e+04 mm, which suggests millimetres read as metres"
        in size_doubts(np.array([6e4, 1e4, 1e4]))[0]
    )


def test_a_long_reach_and_a_foreign_length_are_doubted(tmp_path):
    cable = "[{kind: cable, name: c, points: {mm: [[5, 0, 0], [25, 0, 0]]}, reach: {mm: [0, 12]}}]"
    own = scene(tmp_path, actuators=cable, length="30 m")
    said = doubts(own, build_robot(own, make_mesh(own, tmp_path)[0]))
    assert said == [
        "cable 'c' may be shortened by 12 mm, 60 % of its 20 mm",
        "length is 3e+04 mm, and the body measures 30 x 10 x 10 mm: check its unit",
    ]


def test_a_pressure_in_the_wrong_unit_is_doubted(tmp_path):
    """334 MPa for kPa: the mesh was made without a word."""
    pair = "[{kind: chambers, name: pair, module: 1, chambers: [0], reach: {mm^3: [0, 5]}, pressure: {%s: [0, 334]}}]"
    rod = {"geometry": "{kind: stiff-flop, modules: 1}", "mesh": "{size: 5.5 mm, element: beam}", "length": "55 mm"}
    rod |= {"material": "{law: corotational, young: 150 kPa, poisson: 0.15}"}
    rod |= {"effectors": "[{name: end, point: {mm: [55, 0, 0]}}]"}
    said = {}
    for unit in ("kPa", "MPa"):
        own = scene(tmp_path, actuators=pair % unit, **rod)
        said[unit] = doubts(own, build_robot(own, make_mesh(own, tmp_path)[0]))
    assert said["kPa"] == []
    (one,) = said["MPa"]
    assert one.startswith("the pressure of chambers 'pair' ends at 334 MPa, which would move a linear body by ")
    assert "none survives more than 8: check its unit, and that of Young's modulus" in one


def said_of(tmp_path, **changes):
    own = scene(tmp_path, **changes)
    return doubts(own, build_robot(own, make_mesh(own, tmp_path)[0]))


CABLE = "[{kind: cable, name: c, points: {mm: [%s]}, pull_point: {mm: [%s]}, reach: {%s: [0, %s]}}]"
POINTS = "[5, 0, 3], [15, 0, 3], [25, 0, 3]"
WEIGHT = "{acceleration: {%s: [0, 0, -%s]}}"
MATERIAL = "{young: %s, poisson: %s, density: %s}"
LAYER = "[{faces: {kind: plane, point: {mm: [0, 0, -5]}, normal: [0, 0, -1]}, thickness: 0.1 mm, young: 20 MPa}]"

DOUBTED = {
    "gels": (
        {"material": MATERIAL % ("600 Pa", 0.3, "1070 kg/m^3")},
        "Young's modulus is 0.6 kPa, and 1 kPa to",
    ),
    "diamond": ({"material": MATERIAL % ("600 GPa", 0.3, "1070 kg/m^3")}, "Young's modulus is 600 GPa, and 1 kPa to"),
    "dense": ({"material": MATERIAL % ("1 MPa", 0.3, "1070 g/cm^3")}, "density of material is 1.07e+06 kg/m^3"),
    "light": ({"material": MATERIAL % ("1 MPa", 0.3, "1.07 kg/m^3")}, "density of material is 1.07 kg/m^3"),
    "heavy": ({"gravity": WEIGHT % ("m/s^2", 9810)}, "gravity is 9810 m/s^2, and on earth 9.81 m/s^2"),
    "weightless": ({"gravity": WEIGHT % ("mm/s^2", 9.81)}, "gravity is 0.00981 m/s^2"),
    "locking": ({"material": MATERIAL % ("1 MPa", 0.4999, "1070 kg/m^3")}, "tet4 locks at Poisson's ratio 0.4999"),
    "layer": ({"layers": LAYER}, "tet4 below a layer locks"),
    "micrometres": ({"actuators": CABLE % (POINTS, "0, 0, 3", "um", 3)}, "reach of cable 'c' ends at 0.003 mm, which"),
    "far": ({"actuators": CABLE % (POINTS, "-400, 0, 3", "mm", 3)}, "cable 'c' is pulled from 405 mm away"),
    "backwards": (
        {"actuators": CABLE % ("[25, 0, 3], [15, 0, 3], [5, 0, 3]", "0, 0, 3", "mm", 3)},
        "cable 'c' begins 25 mm from its pull point and ends 5 mm from it",
    ),
    "back over its way": (
        {"actuators": CABLE % ("[5, 0, 3], [20, 0, 3], [10, 0, 3], [25, 0, 3]", "0, 0, 3", "mm", 3)},
        "cable 'c' runs back over its own way at point 1: check their order",
    ),
    "free end": (
        {"actuators": CABLE % ("[25, 0, 3], [15, 0, 3], [5, 0, 3]", "30, 0, 3", "mm", 3)},
        "cable 'c' is pulled from the free end, 30.1 mm from what is held",
    ),
    "twice": (
        {"effectors": "[{name: tip, point: {mm: [29, 0, 0]}}, {name: end, point: {cm: [2.9, 0, 0]}}]"},
        "effectors 'tip' and 'end' watch the same place",
    ),
    "wide": (
        {"geometry": "{kind: bar, length: 30 mm, width: 40 mm, height: 10 mm}"},
        "the bar measures 30 x 40 x 10 mm, wider than its 30 mm of length",
    ),
    "length": ({"length": "300 mm"}, "length is 300 mm, and the body measures 30 x 10 x 10 mm"),
}


@pytest.mark.parametrize("changes, part", DOUBTED.values(), ids=DOUBTED.keys())
def test_what_hardly_can_be_meant_is_doubted_by_name(tmp_path, changes, part):
    common = {"material": MATERIAL % ("1 MPa", 0.3, "1070 kg/m^3"), "gravity": WEIGHT % ("m/s^2", 9.81)}
    said = said_of(tmp_path, **common | changes)
    assert len(said) == 1 and part in said[0], said


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"actuators": CABLE % (POINTS, "0, 0, 3", "mm", 3)},
        {"actuators": CABLE % ("[25, 0, 3]", "0, 0, 3", "mm", 3)},
        {"actuators": CABLE % ("[5, 0, 3], [25, 0, 3], [5, 0, -3]", "0, 0, 3", "mm", 3)},
        {"gravity": WEIGHT % ("m/s^2", 0), "material": MATERIAL % ("1 MPa", 0.3, "1070 kg/m^3")},
        {"mesh": "{size: 5 mm, element: tet10p0}", "material": "{young: 1 MPa, poisson: 0.4999}"},
        {"effectors": "[{name: a, point: {mm: [29, 0, 0]}}, {name: b, point: {mm: [29, 0, 0]}, orientation: true}]"},
    ],
    ids=["bar", "cable", "one point", "there and back", "no gravity", "incompressible", "orientation"],
)
def test_what_can_be_meant_is_not_doubted(tmp_path, changes):
    assert said_of(tmp_path, **changes) == []


def test_a_pressure_that_no_body_survives_is_doubted_before_hours_of_sampling(tmp_path):
    """300 kPa, where 13 kPa is the full stroke."""
    chamber = "[{kind: chambers, name: one, module: 1, chambers: [0, 1], reach: {mm^3: [0, 20]}, %s}]"
    rod = {"geometry": "{kind: stiff-flop, modules: 1}", "mesh": "{size: 5.5 mm, element: beam}", "length": "55 mm"}
    rod |= {"material": "{law: corotational, young: 15 kPa, poisson: 0.15}"}
    rod |= {"effectors": "[{name: end, point: {mm: [55, 0, 0]}}]"}
    assert said_of(tmp_path, actuators=chamber % "pressure: {kPa: [0, 5]}", **rod) == []
    (one,) = said_of(tmp_path, actuators=chamber % "pressure: {kPa: [0, 300]}", **rod)
    assert one.startswith("the pressure of chambers 'one' ends at 0.3 MPa, which would move a linear body by")


def test_the_mesh_of_a_doubtful_scene_is_judged(tmp_path):
    scene(tmp_path, length="30 m")
    (judged,) = run(tmp_path / "scene.yaml", [], None, Options(quiet=True))["results"]["judgement"]
    assert judged["what"].startswith("length")


@pytest.mark.parametrize("path", ["none.step", "none.stl"])
def test_a_missing_shape_is_named_with_its_key(tmp_path, path):
    kind = "step" if path.endswith("step") else "mesh-file"
    scene(tmp_path, geometry=f"{{kind: {kind}, path: {path}}}")
    with pytest.raises(InputError, match=rf"scene\.yaml:4: geometry\.path: no such file: .*{path}") as error:
        run(tmp_path / "scene.yaml", [], None, Options(quiet=True))
    assert "stage" not in str(error.value)


@pytest.mark.parametrize(
    "watched",
    [
        "{name: tip, point: {mm: [0, 3, 2.5]}}",
        "{name: tip, points: {mm: [[0, 3, 2.5], [0, 0, 0]]}}",
        "{name: tip, point: {mm: [0, 0, 0]}, radius: 4 mm, orientation: true}",
    ],
)
@pytest.mark.parametrize("element", ["tet4", "tet10p0", "hex8"])
def test_an_effector_on_a_held_face_is_named(tmp_path, watched, element):
    """The nodes around the point are free, and move the average that stands for it by a little."""
    own = scene(tmp_path, effectors=f"[{watched}]", mesh=f"{{size: 5 mm, element: {element}}}")
    mesh = make_mesh(own, tmp_path)[0]
    with pytest.raises(
        SpecError, match=r"scene\.yaml:9: effectors\.0: effector 'tip' lies where `fixed` holds the body"
    ):
        build_robot(own, mesh)


def test_an_effector_beside_a_held_face_moves(tmp_path):
    for watched in ["{name: tip, point: {mm: [1, 0, 0]}}", "{name: tip, points: {mm: [[0, 0, 0], [1, 0, 0]]}}"]:
        own = scene(tmp_path, effectors=f"[{watched}]")
        assert build_robot(own, make_mesh(own, tmp_path)[0]).rows.n_e == 3
