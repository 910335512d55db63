"""The trunk: its volume from its sections, where its cables run, and its quarter turns."""

from math import pi, sqrt, tan
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
from cfem.robot.places import cable_points, pull_point
from cfem.robot.spec import SceneSpec

SCENE = Path(__file__).parents[3] / "pipelines" / "trunk" / "scene.yaml"
QUARTER = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])


@pytest.fixture(scope="module")
def coarse():
    scene = load_spec(SCENE, SceneSpec, ["mesh.size=14 mm"])
    mesh, volume = make_mesh(scene, SCENE.parent)
    return scene, mesh, volume


def width(z):
    return 26 - 14 * z / 195


def frustum(low, high, share):
    """Volume of a frustum of a regular octagon, whose area is 2 tan(pi / 8) times its width squared."""
    first, second = (2 * tan(pi / 8) * (share * width(z)) ** 2 for z in (low, high))
    return (high - low) / 3 * (first + sqrt(first * second) + second)


def test_volume_and_envelope(coarse):
    _, mesh, volume = coarse
    necks = [10 + 17.5 * disk for disk in range(10)]
    expected = frustum(0, 195, 1.0) - sum(frustum(z, z + 11.5, 1.0) - frustum(z, z + 11.5, 0.63) for z in necks)
    assert volume == pytest.approx(expected, rel=1e-9) and volume == pytest.approx(38_900, rel=0.02)
    assert mesh.volumes.sum() == pytest.approx(volume, rel=1e-12)  # flat sides: nothing is lost between CAD and mesh
    np.testing.assert_allclose([mesh.X.min(axis=0), mesh.X.max(axis=0)], [[-13, -13, 0], [13, 13, 195]], atol=1e-9)


def test_the_body_is_its_own_eighth_turn(coarse):
    _, mesh, _ = coarse
    points = np.random.default_rng(0).uniform([-13, -13, 0], [13, 13, 195], (4000, 3))
    turn = np.array([[sqrt(0.5), -sqrt(0.5), 0], [sqrt(0.5), sqrt(0.5), 0], [0, 0, 1]])
    inside, turned = (locate(mesh, each, within=1e-9)[0] >= 0 for each in (points, points @ turn.T))
    assert inside.mean() > 0.2
    np.testing.assert_array_equal(inside, turned)


def test_cables_lie_in_the_disks_with_the_regions_of_their_points(coarse):
    scene, mesh, _ = coarse
    routes = [cable_points(scene, cable) for cable in scene.actuators]
    assert [len(points) for points in routes] == [20] * 4 + [10] * 4
    assert [cable.reach.tolist() for cable in scene.actuators] == [[0, 13]] * 8
    rim = 2 * np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
    for index, (cable, points) in enumerate(zip(scene.actuators, routes, strict=True)):
        radii, start = np.hypot(*points[:, :2].T), pull_point(scene, cable)
        assert (np.diff(radii) < 0).all() and 2 < radii[-1] < radii[0] < 10
        np.testing.assert_allclose(np.hypot(*start[:2]), 10)
        assert start[2] == 0
        # two points a disk, their regions of 2 mm inside it
        np.testing.assert_array_equal((points[:, 2] - 10) // 17.5, np.repeat(np.arange(len(radii) // 2), 2))
        assert (locate(mesh, (points[:, None] + 0.999 * rim).reshape(-1, 3), within=1e-9)[0] >= 0).all()
        assert ((points[:, 2] - 10) % 17.5 >= 11.5 + 2).all()
        np.testing.assert_allclose(points, routes[index // 4 * 4] @ turns(index).T, atol=1e-4)


def turns(quarters):
    return np.linalg.matrix_power(QUARTER, quarters % 4)


@pytest.mark.slow
def test_one_cable_gives_the_turned_response_of_the_next(coarse):
    """To what the mesh, which is no quarter turn of itself, leaves."""
    scene, mesh, _ = coarse
    problem = Problem(build_robot(scene.model_copy(update={"actuators": scene.actuators[:2]}), mesh))
    np.testing.assert_allclose(problem.robot.rest_e, [0, 0, 195], atol=1e-9)
    one, other = (solve(problem, pull(0.1 * np.eye(2)[cable], np.full(2, 13.0))) for cable in (0, 1))
    assert one.converged and other.converged
    assert one.delta_e[1] > 10 and abs(one.delta_e[0]) < 0.1  # towards the cable that is pulled
    np.testing.assert_allclose(QUARTER @ one.delta_e, other.delta_e, atol=0.01 * np.linalg.norm(one.delta_e))
    assert one.lambda_a[0] == pytest.approx(other.lambda_a[1], rel=0.02)


@pytest.mark.parametrize("override", ["geometry.disks=12", "geometry.disk_thickness=18 mm"])
def test_disks_that_do_not_fit_are_refused(override):
    with pytest.raises(SpecError, match="disk_thickness must be smaller than pitch"):
        load_spec(SCENE, SceneSpec, [override])
