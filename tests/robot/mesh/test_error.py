"""The stated error of a mesh, against meshes so fine that they count as exact."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.fast_cases import fast_are

from cfem.condensed.mesh_error import mesh_error_of
from cfem.core.spec import load_spec
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import displacement
from cfem.equilibrium.system.problem import Problem
from cfem.robot.build import build_robot
from cfem.robot.mesh.error import LOWEST, Compared, chosen, mesh_error, stated
from cfem.robot.mesh.error_spec import MeshErrorSpec
from cfem.robot.mesh.meshing import make_mesh
from cfem.robot.spec import SceneSpec

BAR = Path(__file__).parents[3] / "pipelines" / "bar"
PULLS = (1.0, 2.5, 5.0, 6.5)


def bar(*changes):
    scene = load_spec(BAR / "scene.yaml", SceneSpec, changes)
    mesh = make_mesh(scene, BAR)[0]
    return scene, mesh, build_robot(scene, mesh)


def pulled(problem, amount, start=None):
    found = solve(problem, displacement([amount]), start)
    assert found.converged
    return found


@pytest.fixture(scope="module")
def exact():
    problem = Problem(bar("mesh.element=tet10p0", "mesh.size=2.5 mm")[2])
    states, start = {}, None
    for amount in PULLS:
        states[amount] = pulled(problem, amount, start)
        start = states[amount].state
    return states


@pytest.mark.parametrize(
    "element, size", fast_are({("tet10p0", "8 mm")}, [("tet4", "4 mm"), ("tet10p0", "8 mm"), ("hex8", "5 mm")])
)
def test_the_stated_error_holds_at_commands_from_which_it_was_not_estimated(element, size, exact):
    scene, mesh, robot = bar(f"mesh.element={element}", f"mesh.size={size}")
    problem = Problem(robot)
    found = mesh_error(scene, mesh, robot, BAR, [pulled(problem, 7.5)], MeshErrorSpec())
    error = mesh_error_of(found)
    assert error.states == 1 and error.finer_cells > 2 * error.cells and error.cells == len(mesh.cells)
    for amount, truth in exact.items():
        here = pulled(problem, amount)
        off = np.linalg.norm(truth.delta_e - here.delta_e)
        low, high = error.tip.bounds(np.linalg.norm(here.delta_e))
        assert low < high and off < high < 5 * off, (amount, off, low, high)


def compared(share, travel=20.0, rest=None):
    both = (share if rest is None else rest, share)
    return Compared(travel=travel, reaction=2.0, tip=both, actuators=both, reach=share * travel)


@pytest.mark.parametrize("order", [LOWEST, 1.0, 2.0, 4.0])
def test_an_error_of_any_order_from_the_lowest_on_is_within_the_bounds(order):
    h, smaller = 2.0, 2.0
    at, finer = 0.01 * h**order, 0.01 * (h / smaller) ** order
    found = stated([compared(at - finer)], smaller, 60.0)
    low, high = found["tip"]["far"]
    assert low < at <= high * (1 + 1e-12) and (order > LOWEST or high == pytest.approx(at))
    assert found["tip_mm"] == pytest.approx(20 * high) and found["tip_percent"] == pytest.approx(100 * 20 * high / 60)


def test_states_near_rest_do_not_swell_the_shares_of_large_travels():
    large, small = compared(0.01), compared(0.5, travel=1.0)
    found, alone = (stated(states, 2.0, 60.0) for states in ([large, small], [large]))
    assert found["tip"] == alone["tip"] and found["states"] == 2


def test_of_a_mesh_that_is_too_coarse_nothing_is_stated(exact):
    """What would be stated does not hold: linear tetrahedra twice as large as the bar is wide."""
    scene, mesh, robot = bar("mesh.element=tet4", "mesh.size=25 mm")
    state = pulled(Problem(robot), 5.0)
    found = mesh_error(scene, mesh, robot, BAR, [state], MeshErrorSpec())
    assert (
        set(found) == {"left_out", "apart_percent"}
        and "cells are too few" in found["left_out"]
        and mesh_error_of(found) is None
    )
    error = mesh_error_of(mesh_error(scene, mesh, robot, BAR, [state], MeshErrorSpec(), coarsest=np.inf))
    _, high = error.tip.bounds(np.linalg.norm(state.delta_e))
    assert np.linalg.norm(exact[5.0].delta_e - state.delta_e) > 1.2 * high


def test_a_robot_that_stays_at_rest_has_no_estimate():
    """The share of its reach was 2100 %, by rounding."""
    scene, mesh, robot = bar()
    resting = pulled(Problem(robot), 0.0)
    found = mesh_error(scene, mesh, robot, BAR, [resting], MeshErrorSpec())
    assert found == {"left_out": "the commands leave the robot at rest"} and mesh_error_of(found) is None


def test_where_pressures_are_commanded_displacements_have_the_error():
    scene, mesh, robot = bar()
    state = pulled(Problem(robot), 5.0)
    lengths = mesh_error(scene, mesh, robot, BAR, [state], MeshErrorSpec())
    assert lengths["factorizations"] > 1
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            "cfem.robot.mesh.error.build_robot", lambda *a: replace(build_robot(*a), forces=np.array([[0, 9]]))
        )
        forces = mesh_error(scene, mesh, robot, BAR, [state], MeshErrorSpec())
    assert forces["tip"] != lengths["tip"] and forces["actuators"] != lengths["actuators"]


def test_states_are_far_from_rest_and_from_each_other():
    goals = np.array([[x, 0.0] for x in (0.0, 1.0, 9.0, 8.9, -5.0)])
    assert chosen(goals, np.zeros(2), 3) == [2, 4, 1]
    assert sorted(chosen(goals, np.zeros(2), 99)) == [0, 1, 2, 3, 4]


def test_a_finer_mesh_that_is_too_large_is_not_made():
    scene, mesh, robot = bar()
    found = mesh_error(scene, mesh, robot, BAR, [], MeshErrorSpec(largest=100))
    assert set(found) == {"left_out"} and "mesh_error.largest is 100" in found["left_out"]
