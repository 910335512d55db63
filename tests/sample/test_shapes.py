"""Free form, routings and materials of regions as parameters: derivatives against equilibria of the robots beside."""

import numpy as np
import pytest

from cfem.core.errors import SpecError
from cfem.core.spec import load_spec
from cfem.equilibrium.system.actuation import displacement
from cfem.robot.build import build_robot
from cfem.robot.mesh.meshing import make_mesh
from cfem.robot.spec import SceneSpec
from cfem.sample.family import RobotFamily
from cfem.sample.parameters import scene_parameters, with_values
from cfem.sample.rest import Rest
from cfem.sample.solver import FiniteElements
from cfem.sample.spec import ParameterSpec

SCENE = """
name: bar
out: mesh
length: 60 mm
geometry: {kind: bar, length: 60 mm, width: 10 mm, height: 10 mm}
shape:
  controls:
    - {at: {mm: [30, 0, -5]}, move: {mm: [0, 0, 0.2]}, radius: 15 mm}
    - {at: {mm: [30, 5, 0]}, move: {mm: [0, 0, 0]}, radius: 15 mm, mirror: y}
mesh: {size: 8 mm, element: tet10p0}
material: {law: neo-hookean, young: 1 MPa, poisson: 0.45, density: 1000 kg/m^3}
materials:
  - region: {kind: box, corners: {mm: [[0, -5, -5], [20, 5, 5]]}}
    material: {young: 3 MPa, poisson: 0.4, density: 1200 kg/m^3}
layers:
  - {faces: {kind: plane, point: {mm: [0, 0, -4.9]}, normal: [0, 0, -1]}, thickness: 0.1 mm, young: 10 MPa}
gravity: {acceleration: {m/s^2: [0, 0, -9.81]}}
fixed: [{kind: plane, point: {mm: [1, 0, 0]}, normal: [-1, 0, 0]}]
actuators:
  - kind: cable
    name: up
    points: {mm: [[15, 0, 3], [35, 0, 3], [55, 0, 3]]}
    pull_point: {mm: [0, 0, 3]}
    reach: {mm: [0, 4]}
effectors: [{name: tip, point: {mm: [58, 0, 0]}}, {name: outside, point: {mm: [61, 0, 0]}}]
"""
PULL = displacement(np.array([1.5]))
KINDS = {
    "bulge": ("shape.controls.0.move.2", ["-1 mm", "1 mm"], 0.3, 2e-3),
    "waist": ("shape.controls.1.move.1", {"mm": [-1, 1]}, -0.4, 2e-3),
    "reach": ("shape.controls.0.radius", ["14 mm", "16 mm"], 15.2, 2e-3),
    "inset": ("actuators.0.points.1.2", {"mm": [2, 4]}, 2.7, 2e-3),
    "pulled_at": ("actuators.0.pull_point.2", {"mm": [2, 4]}, 3.3, 2e-3),
    "paper": ("layers.0.young", {"MPa": [5, 20]}, 9.0, 2e-3),
    "stiff": ("materials.0.material.young", {"MPa": [2, 5]}, 3.1, 2e-3),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scene")
    (folder / "scene.yaml").write_text(SCENE)
    return folder


@pytest.fixture(scope="module")
def robot(folder):
    scene = load_spec(folder / "scene.yaml", SceneSpec)
    return scene, make_mesh(scene, folder)[0]


def parameters(folder, *names):
    asked = {name: ParameterSpec(key=KINDS[name][0], range=KINDS[name][1]) for name in names}
    return scene_parameters(asked, folder / "scene.yaml")


@pytest.mark.parametrize(
    "names",
    [
        ("bulge", "waist"),
        ("reach", "stiff"),
        ("paper",),
        pytest.param(("inset", "pulled_at", "bulge"), marks=pytest.mark.slow),
    ],
)
def test_slopes_by_shape_routing_region_and_layer_are_those_of_solved_robots(folder, robot, names):
    found = parameters(folder, *names)
    solve = FiniteElements(*robot, 1e-11, found)().solve
    p = np.array([KINDS[name][2] for name in names])
    here = solve(PULL, None, p)
    assert here.converged
    for index, name in enumerate(names):
        step = KINDS[name][3] * np.eye(len(p))[index]
        ahead, behind = (solve(PULL, here.state, p + sign * step) for sign in (1, -1))
        by_coordinate = p[index] if found[index].coordinate == "log" else 1.0

        def slope(value, step=step[index], by=by_coordinate, ahead=ahead, behind=behind):
            return (value(ahead) - value(behind)) / (2 * step) * by

        assert here.slopes.psi[index] == pytest.approx(slope(lambda one: one.energy), rel=1e-4, abs=1e-6)
        np.testing.assert_allclose(here.slopes.lam[:, index], slope(lambda one: one.lambda_a), rtol=2e-3, atol=1e-6)
        moved = slope(lambda one: one.delta_e)
        np.testing.assert_allclose(here.slopes.delta_e[:, index], moved, atol=2e-3 * np.abs(moved).max())


def test_a_shape_is_the_robot_that_is_built_on_its_mesh(folder, robot):
    scene, mesh = robot
    found = parameters(folder, "bulge", "stiff")
    family = RobotFamily(scene, mesh, found)
    assert family.alike
    design = family.at(np.array([-0.7, 4.0]))
    there = with_values(scene, [one.key for one in found], np.array([-0.7, 4.0]))
    built = build_robot(there, make_mesh(there, folder)[0])
    np.testing.assert_allclose(design.X, built.X, atol=1e-9)
    np.testing.assert_allclose(design.rest_e, built.rest_e, atol=1e-9)
    np.testing.assert_allclose(design.loads, built.loads, atol=1e-12)
    np.testing.assert_allclose(design.actuators[0].rest_length, built.actuators[0].rest_length)
    assert [one.parameters.tolist() for one in design.body.solids] == [
        one.parameters.tolist() for one in built.body.solids
    ]


def test_where_an_effector_beside_the_body_rests_follows_from_the_scene(folder, robot):
    scene, _ = robot
    scene = scene.model_copy(update={"shape": scene.shape.model_copy(update={"controls": [near_the_tip(scene)]})})
    key = "shape.controls.0.move.2"
    one = parameters(folder, "bulge")
    p = np.array([[0.8]])
    there = build_robot(with_values(scene, [key], p[0]), make_mesh(with_values(scene, [key], p[0]), folder)[0])
    rest = Rest(scene, one, build_robot(scene, make_mesh(scene, folder)[0]).rest_e)(p)[0]
    np.testing.assert_allclose(rest[3:], there.rest_e[3:], atol=1e-9)
    np.testing.assert_allclose(rest[:3], there.rest_e[:3], atol=0.05)  # within the body: averaged over its region


def near_the_tip(scene):
    return scene.shape.controls[0].model_copy(update={"at": np.array([60.0, 0, -5])})


@pytest.mark.parametrize(
    ("key", "message"),
    [
        ("actuators.0.points.3.1", "no number at 'actuators.0.points.3.1'"),
        ("actuators.0.points.1", "no number at"),
        ("shape.controls.2.move.1", "no number at"),
        ("shape.controls.0.mirror", "no number at"),
    ],
)
def test_a_coordinate_that_is_not_there_is_said(folder, key, message):
    with pytest.raises(SpecError, match=message):
        scene_parameters({"it": ParameterSpec(key=key, range=["1 mm", "2 mm"])}, folder / "scene.yaml")


def test_coordinates_have_the_unit_of_their_list_and_any_unit_may_be_given(folder):
    asked = {"it": ParameterSpec(key="actuators.0.points.1.2", range=["0.2 cm", "0.4 cm"])}
    (one,) = scene_parameters(asked, folder / "scene.yaml")
    assert (one.unit, one.low, one.high, one.reference) == ("mm", 2.0, 4.0, 3.0)
    with pytest.raises(SpecError, match="bare number"):
        scene_parameters({"it": ParameterSpec(key="actuators.0.points.1.2", range=[2, 4])}, folder / "scene.yaml")


def test_a_free_form_moves_the_body_as_a_geometry_does_and_a_routing_does_not(folder):
    assert [one.moves_body for one in parameters(folder, "bulge", "inset", "stiff")] == [True, False, False]
