"""How much of a tracking result is the mesh: a few of the commands carried out once more, on a finer mesh.

The tracking error is measured against the FE robot on the mesh that the model was trained on, and says nothing of the
error of that mesh. Here the robot on a mesh of about `cells` times as many cells takes the same actuator displacements.
The difference between the two meshes is extrapolated to zero mesh size (Richardson; Roache, Annual Review of Fluid
Mechanics 29, 1997): with cells of size h and h / r the error at h is the difference times r^p / (r^p - 1). Order p = 2
is that of smooth displacements; the finger's graded mesh converges faster, so that its error is overestimated by a
third."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cfem.condensed.spread import outermost, spread
from cfem.control.open_loop.spec import MeshErrorSpec, OpenLoopSpec
from cfem.control.task.loads import under_loads
from cfem.control.task.obstacles.spec import ObstaclesSpec
from cfem.control.task.run_spec import PlannedSpec
from cfem.core.console.progress import doing, progress
from cfem.core.errors import CfemError
from cfem.equilibrium.solve import Wanted, solve
from cfem.equilibrium.system.actuation import displacement
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.robot import Robot
from cfem.equilibrium.system.solution import Equilibrium, State
from cfem.mechanics.mesh import Mesh
from cfem.robot.build import build_robot
from cfem.robot.mesh.finer import carried_over, dimensions, finer_mesh, growth
from cfem.robot.spec import SceneSpec

ORDER = 2.0
STILL = 1e-6  # of the robot's length: below it effectors have not moved


@dataclass(frozen=True)
class MeshDifference:
    """Difference between the robot on the finer mesh and the robot at hand, under the same actuator displacements.

    tip: mm, largest distance of an effector point
    reach: mm, change of how far the effectors are from rest, of `moved` mm
    force: largest change of an actuator force, the largest of which is `carried`"""

    tip: float
    reach: float
    force: float
    moved: float
    carried: float


def states_to_refine(goals: Mapping[str, np.ndarray], spec: PlannedSpec, rest_e: np.ndarray) -> set[tuple[str, int]]:
    """The goals (trajectory, index) whose commands `discretisation` takes."""
    if _left_out(spec):
        return set()
    every = [(name, index) for name, points in goals.items() for index in range(len(points))]
    return {every[number] for number in chosen(np.concatenate(list(goals.values())), rest_e, spec.mesh_error.states)}


def discretisation(
    spec: PlannedSpec, scene: SceneSpec, mesh: Mesh, robot: Robot, folder: Path, states: Sequence[Equilibrium]
) -> dict[str, Any]:
    """`mesh_error` as the spec asks for it; only `left_out`, the reason, where there is none."""
    why = _left_out(spec)
    if why:
        return {"left_out": why}
    return mesh_error(scene, mesh, robot, folder, states, spec.mesh_error, partial(under_loads, spec))


def _left_out(spec: PlannedSpec) -> str:
    """Reason why nothing is to be estimated, empty where there is none."""
    if isinstance(spec, ObstaclesSpec):
        return "the estimate does not know contact"
    if not isinstance(spec, OpenLoopSpec) or spec.design:
        return "runs with an object or a design have no estimate yet"
    if spec.mesh_error is None:
        return "mesh_error is null in the spec"
    return "" if spec.plant == "fem" else "no FE robot carried out the commands"


def chosen(goals: Sequence[np.ndarray], rest_e: np.ndarray, count: int) -> list[int]:
    """Indices of `count` goals: the one farthest from rest, then again and again the goal farthest from those
    chosen."""
    points = np.array(goals)
    return spread(points, count, outermost(points, rest_e)).tolist()


def mesh_error(
    scene: SceneSpec,
    mesh: Mesh,
    robot: Robot,
    folder: Path,
    states: Sequence[Equilibrium],
    spec: MeshErrorSpec,
    load: Callable[[Robot], Robot] = lambda robot: robot,
) -> dict[str, Any]:
    """Estimated discretisation error, for the manifest. states: of the robot on `mesh`, at the commands chosen; load:
    puts the loads of these states on the robot of the finer mesh.

    states, cells, finer_cells, order: how it was estimated. tip_mm, tip_percent: error of the effectors' position, of
        the scene's length too; reach_percent: of how far the effectors move; force_percent: of the actuator forces, of
        the largest one; all the largest of the states, extrapolated. Where it could not be estimated, only `left_out`:
        the sentence that says why."""
    expected = growth(scene, spec.cells) * len(mesh.cells)
    if expected > spec.largest:
        return {"left_out": f"the finer mesh would have {expected:.0f} cells, and mesh_error.largest is {spec.largest}"}
    if states and max(np.abs(state.delta_e).max() for state in states) <= STILL * robot.length:
        return {"left_out": "the commands leave the robot at rest"}
    doing("meshing more finely, for the discretisation error")
    try:
        finer = finer_mesh(scene, mesh, robot, folder, spec.cells)
        refined = load(build_robot(scene, finer))
    except CfemError as error:
        return {"left_out": f"there is no finer mesh: {error}"}
    problem, differences = Problem(refined), []
    with progress("commands on the finer mesh", len(states)) as advance:
        for state in states:
            hexahedra = mesh.cells.shape[1] == 8
            start = None if hexahedra else State(carried_over(mesh, state.state.x, finer), np.empty(0), state.state.lam)
            solved = solve(problem, displacement(state.delta_a), start, wanted=Wanted(condense=False))
            advance(1)
            if solved.converged:
                differences.append(_difference(robot, state, solved))
    if not differences:
        return {"left_out": "no state converged on the finer mesh"}
    smaller = (len(finer.cells) / len(mesh.cells)) ** (1 / dimensions(scene))
    return {
        "states": len(differences),
        "cells": len(mesh.cells),
        "finer_cells": len(finer.cells),
        "order": ORDER,
        **extrapolated(differences, smaller, robot.length),
    }


def extrapolated(differences: Sequence[MeshDifference], smaller: float, length: float) -> dict[str, float]:
    """Errors of the mesh at hand from the largest differences to a mesh of cells `smaller` times as small. Percentages
    are of the largest of all states: near rest there is next to nothing to compare with."""
    gain = smaller**ORDER
    factor = gain / (gain - 1)
    tip, reach, force, moved, carried = (
        max(getattr(difference, key) for difference in differences)
        for key in ("tip", "reach", "force", "moved", "carried")
    )
    tip, moved, carried = factor * tip, max(moved, np.finfo(float).tiny), max(carried, np.finfo(float).tiny)
    return {
        "tip_mm": tip,
        "tip_percent": 100 * tip / length,
        "reach_percent": 100 * factor * reach / moved,
        "force_percent": 100 * factor * force / carried,
    }


def _difference(robot: Robot, coarse: Equilibrium, finer: Equilibrium) -> MeshDifference:
    """Difference between two meshes of one state; orientations of effectors are left out, as they are no lengths."""
    places = [index for index, name in enumerate(robot.rows.effectors) if not name.split(".")[-1].startswith("r")]
    moved, differently = coarse.delta_e[places], finer.delta_e[places]
    return MeshDifference(
        tip=float(np.linalg.norm(differently - moved)),
        reach=float(abs(np.linalg.norm(differently) - np.linalg.norm(moved))),
        force=float(np.abs(finer.lambda_a - coarse.lambda_a).max()),
        moved=float(np.linalg.norm(moved)),
        carried=float(np.abs(coarse.lambda_a).max()),
    )
