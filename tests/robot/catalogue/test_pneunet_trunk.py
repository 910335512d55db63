"""The trunk of PneuNets: its volume and its chambers from its lengths, and that its walls touch."""

from pathlib import Path

import numpy as np
import pytest

from cfem.core.errors import SpecError
from cfem.core.spec import load_spec
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import displacement
from cfem.equilibrium.system.problem import Problem
from cfem.robot.build import build_robot
from cfem.robot.mesh.meshing import make_mesh
from cfem.robot.spec import SceneSpec

SCENE = Path(__file__).parents[3] / "pipelines" / "pneunet-trunk" / "scene.yaml"


def scene(*changes):
    return load_spec(SCENE, SceneSpec, list(changes))


@pytest.fixture(scope="module")
def small():
    """Meshed coarsely, so that a solve is short."""
    own = scene("mesh.size=15 mm")
    mesh, volume = make_mesh(own, SCENE.parent)
    return mesh, volume, build_robot(own, mesh)


def trapezoid(low, high):
    """Area between two distances from the axis, 1.5 mm from the neighbours' across the diagonal."""
    aside = 1.5 / np.sqrt(2)
    return (high - low) * (low + high - 2 * aside)


def test_volume_and_chambers_are_those_of_its_lengths(small):
    mesh, volume, robot = small
    chamber = 2 * 5 * trapezoid(2.5, 13.5) + 4 * trapezoid(2.5, 4.5)  # rooms, and the duct between them
    assert volume == pytest.approx(2 * 8 * 30**2 + 1 * 12**2 - 4 * chamber)
    assert mesh.volumes.sum() == pytest.approx(volume)
    assert [each.rest_volume for each in robot.actuators] == pytest.approx([chamber] * 4)
    assert robot.rest_e.tolist() == [17.0, 0.0, 0.0]
    np.testing.assert_allclose([mesh.X.min(axis=0), mesh.X.max(axis=0)], [[0, -15, -15], [17, 15, 15]], atol=1e-9)


def test_a_chamber_bends_it_to_the_other_side_and_its_walls_touch_between_the_cells(small):
    _, _, robot = small
    problem, state, pushing = Problem(robot), None, []
    for volume in (200.0, 900.0):
        state = solve(problem, displacement([volume, 0.0, 0.0, 0.0]), base=state and state.state)
        assert state.converged
        pushing.append(problem.evaluate(state.state.x, state.state.pressure).response.contact.pairs)
    dx, dy, dz = state.delta_e
    assert dx > 0 and dy < -1.0 and abs(dz) < 0.1 * abs(dy)
    assert state.lambda_a[0] > 5 * np.abs(state.lambda_a[1:]).max()
    assert len(pushing[0]) == 0 and len(pushing[1]) > 10
    contact = robot.body.contact
    places = robot.X[contact.nodes[pushing[1], :3]]
    assert (np.abs(places[:, :, 0] - 8.5) < 0.5 + 1e-9).all()  # the gap is from 8 to 9 mm


@pytest.mark.parametrize(
    "change, said",
    [
        ("geometry.wall=4 mm", "2 wall must be smaller than cell_length"),
        ("geometry.duct=11 mm", "core, duct and wall together than width / 2"),
        ("geometry.core=1.5 mm", "the core must be larger than the wall"),
    ],
)
def test_lengths_that_do_not_go_together_are_refused(change, said):
    with pytest.raises(SpecError, match=said):
        scene(change)


def test_a_cable_through_it_has_points_and_no_route():
    cable = "[{kind: cable, name: c, route: {side: y+}, reach: {mm: [0, 3]}}]"
    with pytest.raises(SpecError, match="cables through a pneunet-trunk have points, not a route"):
        scene(f"actuators={cable}")
