"""Error of the mesh in a tracking result: a few of the commands carried out once more, on a finer mesh.

The tracking error is measured against the FE robot on the mesh that the model was trained on, and says nothing of the
error of that mesh."""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cfem.control.open_loop.spec import OpenLoopSpec
from cfem.control.task.loads import under_loads
from cfem.control.task.obstacles.spec import ObstaclesSpec
from cfem.control.task.run_spec import PlannedSpec
from cfem.equilibrium.system.robot import Robot
from cfem.equilibrium.system.solution import Equilibrium
from cfem.mechanics.mesh import Mesh
from cfem.robot.mesh.error import chosen, mesh_error
from cfem.robot.spec import SceneSpec


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
