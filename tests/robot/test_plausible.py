"""What hardly can be meant is judged, with the numbers in the sentence."""

import numpy as np
import pytest
from robot.scenes import scene

from cfem.core.errors import InputError, SpecError
from cfem.core.stage import Options
from cfem.robot.build import build_robot
from cfem.robot.mesh.meshing import make_mesh
from cfem.robot.plausible import doubts, size_doubts
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
    assert said["MPa"] == [
        "the pressure of chambers 'pair' may be 334 MPa, 2227 times Young's modulus of 0.15 MPa: check their units"
    ]


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
