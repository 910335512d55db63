"""The diamond: its envelope, its quarter turns, and that a cable does what its neighbour does, turned."""

from pathlib import Path

import numpy as np
import pytest

from cfem.constraint.attachment import locate
from cfem.core.errors import SpecError
from cfem.core.spec import load_spec
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import pull
from cfem.equilibrium.system.problem import Problem
from cfem.robot.build import build_robot
from cfem.robot.mesh.meshing import make_mesh
from cfem.robot.spec import SceneSpec

SCENE = Path(__file__).parents[3] / "pipelines" / "diamond" / "scene.yaml"
QUARTER = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])


@pytest.fixture(scope="module")
def coarse():
    scene = load_spec(SCENE, SceneSpec, ["mesh.size=30 mm"])
    mesh, volume = make_mesh(scene, SCENE.parent)
    return scene, mesh, volume


def test_volume_and_envelope(coarse):
    _, mesh, volume = coarse
    assert volume == pytest.approx(392_000, rel=0.02)
    assert mesh.volumes.sum() == pytest.approx(volume, rel=1e-12)  # flat sides: nothing is lost between CAD and mesh
    np.testing.assert_allclose([mesh.X.min(axis=0), mesh.X.max(axis=0)], [[-97, -97, -37], [97, 97, 126]], atol=1e-9)


def test_the_body_is_its_own_quarter_turn(coarse):
    _, mesh, _ = coarse
    points = np.random.default_rng(0).uniform([-97, -97, -37], [97, 97, 126], (4000, 3))
    inside, turned = (locate(mesh, each, within=1e-9)[0] >= 0 for each in (points, points @ QUARTER.T))
    assert inside.mean() > 0.05
    np.testing.assert_array_equal(inside, turned)


def test_what_is_held_and_where_the_cables_pull(coarse):
    scene, mesh, _ = coarse
    robot = build_robot(scene, mesh)
    held = mesh.X[robot.fixed]
    assert held[:, 2].max() <= 10 + 1e-9 and np.abs(held[:, :2]).max() <= 15 + 1e-9
    np.testing.assert_allclose(robot.rest_e, [0, 0, 125], atol=1e-9)
    assert robot.reach.tolist() == [[0, 30]] * 4 and robot.unilateral.all()
    point, start = np.array([0.0, 97, 45]), np.array([0.0, 10, 30])
    for cable in robot.actuators:
        np.testing.assert_allclose(cable.along @ mesh.X[cable.nodes], [point], atol=1e-9)
        np.testing.assert_allclose(-cable.start, [start], atol=1e-9)
        point, start = QUARTER @ point, QUARTER @ start


def test_one_cable_gives_the_turned_response_of_the_next(coarse):
    """To what the mesh, which is no quarter turn of itself, leaves."""
    problem = Problem(build_robot(*coarse[:2]))
    one, other = (solve(problem, pull(0.4 * np.eye(4)[cable], np.full(4, 30.0))) for cable in (0, 1))
    assert one.converged and other.converged
    assert one.delta_e[1] < -15 and abs(one.delta_e[0]) < 0.3  # away from the knee that is pulled in
    np.testing.assert_allclose(QUARTER @ one.delta_e, other.delta_e, atol=0.02 * np.linalg.norm(one.delta_e))
    assert one.lambda_a[0] == pytest.approx(other.lambda_a[1], rel=0.02)


def test_a_hinge_thicker_than_its_leg_is_refused():
    with pytest.raises(SpecError, match="hinge_thickness must be smaller"):
        load_spec(SCENE, SceneSpec, ["geometry.hinge_thickness=14 mm"])
