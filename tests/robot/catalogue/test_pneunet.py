"""The PneuNet: its volume and its chamber from its lengths, and that the paper below it makes it bend."""

from pathlib import Path

import numpy as np
import pytest

from cfem.constraint.surface import outer_surface
from cfem.constraint.surface_points import at_nodes
from cfem.contact.obstacle import Plane
from cfem.contact.obstacle_set import ObstacleSet
from cfem.core.errors import SpecError
from cfem.core.spec import load_spec
from cfem.equilibrium.contact.skinned_robot import SkinnedRobot
from cfem.equilibrium.contact.surfaces import SurfaceScene
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import displacement
from cfem.equilibrium.system.problem import Problem
from cfem.robot.build import build_robot
from cfem.robot.mesh.meshing import make_mesh
from cfem.robot.spec import SceneSpec

SCENE = Path(__file__).parents[3] / "pipelines" / "pneunet" / "scene.yaml"


def scene(*changes):
    return load_spec(SCENE, SceneSpec, list(changes))


@pytest.fixture(scope="module")
def small():
    """Two cells, so that a solve is short."""
    own = scene("geometry.cells=2", "length=21.5 mm", "mesh.size=8 mm")
    mesh, volume = make_mesh(own, SCENE.parent)
    return mesh, volume, build_robot(own, mesh)


def test_volume_and_chamber_are_those_of_its_lengths(small):
    mesh, volume, robot = small
    room, slab, cell = 7 * 12 * 13.5, 6.5 * 15 * 21.5, 10 * 15 * (18 - 6.5)
    duct = 2 * 2 * (21.5 - 3) - 2 * (2 * 2 * 7)  # but for what lies in the rooms
    assert volume == pytest.approx(slab + 2 * cell - 2 * room - duct)
    assert mesh.volumes.sum() == pytest.approx(volume)
    assert robot.actuators[0].rest_volume == pytest.approx(2 * room + duct)
    assert robot.rest_e.tolist() == [21.5, 0.0, 1.5]
    np.testing.assert_allclose([mesh.X.min(axis=0), mesh.X.max(axis=0)], [[0, -7.5, 0], [21.5, 7.5, 18]], atol=1e-9)


def test_it_bends_about_its_paper_which_keeps_its_length(small):
    mesh, _, robot = small
    state = solve(Problem(robot), displacement([300.0]))
    assert state.converged and state.lambda_a[0] > 0
    dx, dy, dz = state.delta_e
    assert dz < -1.0 and abs(dx) < abs(dz) / 3 and abs(dy) < 1e-5
    line = np.flatnonzero((np.abs(mesh.X[:, 1]) < 1e-9) & (mesh.X[:, 2] < 1e-9))
    line = line[np.argsort(mesh.X[line, 0])]
    length = np.linalg.norm(np.diff(state.state.x[line], axis=0), axis=1).sum()
    assert length == pytest.approx(21.5, rel=3e-3)


def test_what_stops_its_tip_carries_what_a_table_carries_at_its_nodes(small):
    points = "actuators.1.points={mm: [[21.5, -6, 0], [21.5, -3, 0], [21.5, 0, 0], [21.5, 3, 0], [21.5, 6, 0]]}"
    changes = ["geometry.cells=2", "length=21.5 mm", "mesh.size=8 mm", points]
    stopped = build_robot(load_spec(SCENE.with_name("scene-blocked.yaml"), SceneSpec, changes), small[0])
    state = solve(Problem(stopped), displacement([400.0, -0.5]))
    robot, facets = small[2], small[0].facets
    surface = outer_surface(robot.X, facets)
    nodes = SkinnedRobot(robot, surface.nodes, surface.triangles, at_nodes(robot.X, facets, surface), itself=False)
    table = ObstacleSet((Plane(t=np.array([0.0, 0.0, -0.5])),))
    pressed = SurfaceScene([nodes], table).go([[400.0]])
    assert state.converged and pressed.converged
    force = pressed.forces.sum(axis=0)[2]
    assert force > 0.1 and state.lambda_a[1] == pytest.approx(force, rel=0.02)
    assert state.lambda_a[0] == pytest.approx(pressed.solved[0].lambda_a[0], rel=0.005)


@pytest.mark.parametrize(
    "change, said",
    [
        ("geometry.wall=5 mm", "2 wall must be smaller than cell_length and width"),
        ("geometry.floor=15 mm", "floor, duct and wall together than height"),
        ("geometry.duct=12 mm", "the duct must be narrower than a room"),
    ],
)
def test_lengths_that_do_not_go_together_are_refused(change, said):
    with pytest.raises(SpecError, match=said):
        scene(change)


def test_a_cable_through_it_has_points_and_no_route():
    cable = "[{kind: cable, name: c, route: {side: y+}, reach: {mm: [0, 3]}}]"
    with pytest.raises(SpecError, match="cables through a pneunet have points, not a route"):
        scene(f"actuators={cable}")
