"""Designs to which a mesh does not stretch: a mesh of their own, which serves their neighbours, and the jump of W."""

import numpy as np
import pytest

from cfem.condensed.parameters import Parameter
from cfem.core.errors import NumericalError
from cfem.core.spec import load_spec
from cfem.core.stage import Options
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import displacement
from cfem.equilibrium.system.problem import Problem
from cfem.parametric import meshes
from cfem.parametric.differentiable import Differentiable
from cfem.parametric.family import FiniteElementFamily
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh
from cfem.robot.mesh.accuracy import scene_mesh
from cfem.robot.spec import SceneSpec
from cfem.robot.stage import run as make_mesh
from cfem.sample.parameters import with_values

SCENE = """
name: bar
out: mesh
length: 60 mm
geometry: {kind: bar, length: 60 mm, width: 10 mm, height: 10 mm}
mesh: {size: 8 mm, element: tet10p0}
material: {law: neo-hookean, young: 1 MPa, poisson: 0.4}
fixed: [{kind: plane, point: {mm: [1, 0, 0]}, normal: [-1, 0, 0]}]
actuators:
  - {kind: cable, name: up, points: {mm: [[15, 0, 3], [55, 0, 3]]}, pull_point: {mm: [0, 0, 3]}, reach: {mm: [0, 4]}}
effectors: [{name: tip, point: {mm: [58, 0, 0]}}]
"""
PARAMETERS = (
    Parameter("height", "geometry.height", "mm", 7.6, 12.0, 10.0),
    Parameter("young", "material.young", "MPa", 0.5, 2.0, 1.0, "log"),
)
PULL = np.array([2.0])
FAR, NEAR, WITHIN = (np.array([height, 1.0]) for height in (8.0, 9.5, 9.8))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("meshes")
    (folder / "scene.yaml").write_text(SCENE)
    make_mesh(folder / "scene.yaml", [], None, Options(quiet=True))
    return folder


@pytest.fixture
def robot(folder, monkeypatch):
    """Its mesh counts as stretched too far where a cell has less than 0.9 of its volume."""
    monkeypatch.setattr("cfem.robot.shape.morph.THINNEST", 0.9)
    return load_scene_and_mesh(folder / "scene.yaml", folder / "mesh")


def test_without_a_folder_a_design_too_far_is_refused(robot):
    with pytest.raises(NumericalError, match="of its volume left"):
        FiniteElementFamily(*robot, PARAMETERS).at("displacement", PULL, FAR[None])


def test_a_design_too_far_is_the_robot_on_its_own_mesh(folder, robot):
    found = FiniteElementFamily(*robot, PARAMETERS, folder)
    states = found.at("displacement", PULL, np.array([WITHIN, FAR]))
    assert len(found.meshes.own) == 1 and found.meshes.own[0].p == pytest.approx(FAR)
    scene = with_values(load_spec(folder / "scene.yaml", SceneSpec), ["geometry.height"], FAR[:1])
    alone = solve(Problem(build_robot(scene, scene_mesh(scene, folder)[0])), displacement(PULL))
    np.testing.assert_allclose(states.W[1], alone.condensed.W, rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(states.delta_e[1], alone.delta_e, atol=1e-7)


def test_neighbours_share_a_mesh_and_its_gradients(folder, robot):
    """Differences of solves along the height see no new mesh."""
    found = Differentiable(*robot, PARAMETERS, folder=folder)
    found.at("displacement", PULL, FAR[None])
    h = 0.02
    states = found.at("displacement", PULL, np.array([FAR + [k * h, 0] for k in (2, 1, -1, -2)]))
    assert len(found.meshes.own) == 1
    plain = (8 * (states.W[1] - states.W[2]) - (states.W[0] - states.W[3])) / (12 * h)
    _, slopes = found.jacobian("displacement", PULL, FAR, [0])
    np.testing.assert_allclose(slopes.W[:, :, 0] / (12.0 - 7.6), plain, atol=1e-5 * np.abs(plain).max())


def test_the_jump_is_that_at_the_edge_of_the_scenes_mesh(folder, robot):
    found = FiniteElementFamily(*robot, PARAMETERS, folder)
    found.at("displacement", PULL, NEAR[None])
    edge = found.meshes.edge(found.meshes.own[0])
    found.meshes.main.at(edge)
    with pytest.raises(NumericalError, match="of its volume left"):
        found.meshes.main.at(edge - [0.02, 0.0])
    (jump,) = found.jumps("displacement", PULL)
    assert jump["p"] == {"height": pytest.approx(9.5), "young": pytest.approx(1.0)} and jump["cells"] > 50
    assert 1e-6 < jump["W_share"] < 0.1 and 0 < jump["effector_distance"] < 1.0


def test_the_number_of_meshes_has_an_end(folder, robot, monkeypatch):
    monkeypatch.setattr(meshes, "MOST", 1)
    monkeypatch.setattr("cfem.robot.shape.morph.THINNEST", 0.999)
    found = FiniteElementFamily(*robot, PARAMETERS, folder)
    with pytest.raises(NumericalError, match="1 designs have meshes of their own already"):
        found.at("displacement", PULL, np.array([FAR, FAR - [0.3, 0.0]]))
