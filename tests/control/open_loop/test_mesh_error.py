"""The estimated discretisation error, against meshes so fine that they count as exact."""

from pathlib import Path

import numpy as np
import pytest

from cfem.control.open_loop.mesh_error import ORDER, MeshDifference, chosen, discretisation, extrapolated, mesh_error
from cfem.control.open_loop.spec import MeshErrorSpec
from cfem.control.spec import ControlSpec
from cfem.core.spec import load_spec
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import displacement
from cfem.equilibrium.system.problem import Problem
from cfem.robot.build import build_robot
from cfem.robot.mesh.meshing import make_mesh
from cfem.robot.spec import SceneSpec

BAR = Path(__file__).parents[3] / "pipelines" / "bar"


def bar(*changes):
    scene = load_spec(BAR / "scene.yaml", SceneSpec, changes)
    mesh = make_mesh(scene, BAR)[0]
    return scene, mesh, build_robot(scene, mesh)


def pulled(robot, amount):
    found = solve(Problem(robot), displacement([amount]))
    assert found.converged
    return found


@pytest.mark.parametrize("element, size", [("tet4", "4 mm"), ("tet10p0", "8 mm"), ("hex8", "5 mm")])
def test_the_estimate_is_the_error_to_a_factor_of_two_and_a_half(element, size):
    scene, mesh, robot = bar(f"mesh.element={element}", f"mesh.size={size}")
    found = mesh_error(scene, mesh, robot, BAR, [pulled(robot, 5.0)], MeshErrorSpec(cells=3))
    _, _, exact = bar("mesh.element=tet10p0", "mesh.size=2.5 mm")
    truth, here = pulled(exact, 5.0), pulled(robot, 5.0)
    error = np.linalg.norm(truth.delta_e - here.delta_e)
    assert error / 2.5 < found["tip_mm"] < 2.5 * error
    force = 100 * abs(truth.lambda_a - here.lambda_a)[0] / here.lambda_a[0]
    assert force / 2.5 < found["force_percent"] < 2.5 * force or max(force, found["force_percent"]) < 0.2
    assert found["states"] == 1 and found["finer_cells"] > found["cells"] == len(mesh.cells)


def test_errors_of_the_stated_order_are_extrapolated_exactly():
    h, smaller = 2.0, 1.4
    at, finer = 0.03 * h**ORDER, 0.03 * (h / smaller) ** ORDER
    both = [MeshDifference(at - finer, 0.0, 0.1, 5.0, 2.0), MeshDifference(0.0, at - finer, 0.0, 10.0, 1.0)]
    found = extrapolated(both, smaller, 60.0)
    assert found["tip_mm"] == pytest.approx(at) and found["tip_percent"] == pytest.approx(100 * at / 60)
    assert found["reach_percent"] == pytest.approx(10 * at)


def test_a_state_at_rest_does_not_swell_the_shares():
    pulled, resting = MeshDifference(0.1, 0.1, 0.2, 10.0, 4.0), MeshDifference(0.1, 0.1, 0.2, 1e-9, 1e-12)
    found = extrapolated([pulled, resting], 2.0, 60.0)
    assert found == extrapolated([pulled], 2.0, 60.0) and found["force_percent"] == pytest.approx(100 * 0.05 * 4 / 3)


def test_a_robot_that_stays_at_rest_has_no_estimate():
    """The share of its reach was 2100 %, by rounding."""
    scene, mesh, robot = bar()
    found = mesh_error(scene, mesh, robot, BAR, [pulled(robot, 0.0)], MeshErrorSpec())
    assert found == {"left_out": "the commands leave the robot at rest"}


def test_states_are_far_from_rest_and_from_each_other():
    goals = [np.array([x, 0.0]) for x in (0.0, 1.0, 9.0, 8.9, -5.0)]
    assert chosen(goals, np.zeros(2), 3) == [2, 4, 1]
    assert sorted(chosen(goals, np.zeros(2), 99)) == [0, 1, 2, 3, 4]


def test_a_finer_mesh_that_is_too_large_is_not_made():
    scene, mesh, robot = bar()
    found = mesh_error(scene, mesh, robot, BAR, [], MeshErrorSpec(largest=100))
    assert set(found) == {"left_out"} and "mesh_error.largest is 100" in found["left_out"]


@pytest.mark.parametrize(
    "changes, words",
    [
        (["mesh_error=null"], "mesh_error is null"),
        (["obstacles={lid: {kind: plane, point: {mm: [0, 0, 9]}, normal: [0, 0, -1]}}", "fe_based=false"], "contact"),
        (
            ["plant=model", "fe_based=false", "trajectories={a: {kind: goals, points: {mm: [[55, 0, 5]]}}}"],
            "no FE robot",
        ),
    ],
)
def test_what_leaves_it_out_is_said(changes, words):
    spec = load_spec(BAR / "control.yaml", ControlSpec, changes)
    assert words in discretisation(spec, None, None, None, BAR, [])["left_out"]
