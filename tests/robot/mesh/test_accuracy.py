"""A mesh that has the error which the scene allows."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from cfem.core.errors import NumericalError, SpecError
from cfem.core.spec import load_spec
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.problem import Problem
from cfem.robot.build import build_robot
from cfem.robot.mesh import accuracy, grading
from cfem.robot.mesh.accuracy import accurate_mesh, at_reach, scene_mesh
from cfem.robot.mesh.error_spec import MeshErrorSpec
from cfem.robot.spec import SceneSpec

BAR = Path(__file__).parents[3] / "pipelines" / "bar"


def bar(*changes):
    return load_spec(BAR / "scene.yaml", SceneSpec, changes)


def stating(share):
    """`mesh_error` of meshes whose error is `share(cells)`, and the cells that were asked about."""
    asked = []

    def found(scene, mesh, robot, folder, states, spec, coarsest):
        asked.append(len(mesh.cells))
        bounds = [share(len(mesh.cells)) / 2, share(len(mesh.cells))]
        shares = {"rest": bounds, "far": bounds, "largest": 30.0}
        meshes = {"states": len(states), "cells": len(mesh.cells), "finer_cells": 8 * len(mesh.cells)}
        return {"tip": shares, "actuators": shares, **meshes}

    return found, asked


def test_meshes_are_made_finer_until_one_is_accurate_enough(monkeypatch):
    found, asked = stating(lambda cells: (40 / cells) ** (2 / 3))
    monkeypatch.setattr(accuracy, "mesh_error", found)
    monkeypatch.setattr(accuracy, "at_reach", lambda robot: [None])
    monkeypatch.setattr(accuracy, "FIRST", 100)
    monkeypatch.setattr(grading, "PASSES", 1)
    mesh, volume, error = accurate_mesh(bar("mesh.accuracy=15 %", "mesh.size=20 mm"), BAR)
    assert 1 < len(asked) < 5 and asked == sorted(asked) and asked[-1] == len(mesh.cells) < 3 * 40 / 0.15**1.5
    assert error["tip"]["far"][1] <= 0.15 < (40 / asked[-2]) ** (2 / 3) and volume == pytest.approx(6000)


def test_a_mesh_that_is_foretold_to_err_too_much_is_not_compared_with_a_finer_one(monkeypatch):
    """Error and indicator go with the square of the cells' size, and each mesh has three times as many at most."""
    found, asked = stating(lambda cells: 0.8 * (100 / cells) ** (2 / 3))
    made = []

    def indicated(robot):
        made.append(len(robot.body.mesh.cells))
        return SimpleNamespace(squared=np.array([made[-1] ** (-2 / 3)]))

    monkeypatch.setattr(accuracy, "mesh_error", found)
    monkeypatch.setattr(accuracy, "estimate", indicated)
    monkeypatch.setattr(accuracy, "at_reach", lambda robot: [None])
    monkeypatch.setattr(accuracy, "_MOST", 3.0)
    monkeypatch.setattr(accuracy, "FIRST", 100)
    monkeypatch.setattr(grading, "PASSES", 2)
    mesh, _, error = accurate_mesh(bar("mesh.accuracy=13 %", "mesh.size=20 mm"), BAR)
    assert len(made) > 2 and asked == [made[0], made[-1]] and error["cells"] == len(mesh.cells) == made[-1]


def test_an_error_that_takes_more_cells_than_can_be_judged_is_said_at_once(monkeypatch):
    found, asked = stating(lambda cells: (40 / cells) ** (1 / 3))
    monkeypatch.setattr(accuracy, "mesh_error", found)
    monkeypatch.setattr(accuracy, "at_reach", lambda robot: [None])
    monkeypatch.setattr(accuracy, "FIRST", 100)
    monkeypatch.setattr(grading, "PASSES", 1)
    monkeypatch.setattr(accuracy, "MeshErrorSpec", lambda states: MeshErrorSpec(states=states, largest=8 * 300))
    with pytest.raises(NumericalError, match=r"would be needed, and more than 300 cannot be compared"):
        accurate_mesh(bar("mesh.accuracy=5 %", "mesh.size=20 mm"), BAR)
    assert len(asked) == 1


@pytest.mark.slow
def test_its_error_is_estimated_on_the_mesh_that_is_made():
    mesh, _, error = accurate_mesh(bar("mesh.accuracy=6 %", "mesh.size=20 mm"), BAR)
    assert error["cells"] == len(mesh.cells) and 0 < error["tip"]["far"][0] < error["tip"]["far"][1] < 0.06


def test_the_states_are_those_at_the_ends_of_the_reach():
    robot = build_robot(bar(), scene_mesh(bar(), BAR)[0])
    (state,) = at_reach(robot)
    assert state.delta_a == pytest.approx([8.0])
    assert solve(Problem(robot), accuracy._command(robot, 0)).delta_e == pytest.approx(state.delta_e, abs=1e-6)


def test_an_accuracy_that_no_mesh_has_is_said_with_what_the_last_one_leaves(monkeypatch):
    monkeypatch.setattr(accuracy, "mesh_error", stating(lambda cells: 0.5)[0])
    monkeypatch.setattr(accuracy, "ROUNDS", 1)
    monkeypatch.setattr(accuracy, "FIRST", 100)
    monkeypatch.setattr(grading, "PASSES", 1)
    with pytest.raises(NumericalError, match=r"no mesh with an error of 30 % was found: \d+ cells leave 50 %"):
        accurate_mesh(bar("mesh.accuracy=30 %", "mesh.size=20 mm"), BAR)


@pytest.mark.parametrize("change", ["mesh.cells=500", "mesh.element=hex8"])
def test_it_is_of_tetrahedra_and_in_place_of_a_number_of_cells(change):
    with pytest.raises(SpecError, match=r"mesh\.accuracy"):
        bar("mesh.accuracy=1 %", change)


def test_percent_is_a_share():
    assert bar("mesh.accuracy=1 %").mesh.accuracy == bar("mesh.accuracy=0.01").mesh.accuracy == 0.01
