"""The error of the mesh over the range of a dataset: some of its states once more on a finer mesh."""

from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.console.shown import counted, length
from cfem.dataset.reader import read_dataset
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import displacement, force
from cfem.equilibrium.system.problem import Problem
from cfem.mechanics.mesh import Mesh
from cfem.robot.build import build_robot
from cfem.robot.mesh.error import chosen, mesh_error
from cfem.robot.mesh.error_spec import MeshErrorSpec
from cfem.robot.spec import SceneSpec


def sampled_mesh_error(
    dataset: Path, scene: SceneSpec, mesh: Mesh, scene_folder: Path, spec: MeshErrorSpec
) -> dict[str, Any]:
    """Error of the mesh (`cfem.robot.mesh.error`) at the training states in which effectors travel farthest, for the
    scene's own robot. dataset: file of these states."""
    rows = read_dataset(dataset)
    robot = build_robot(scene, mesh)
    problem, states = Problem(robot), []
    for index in chosen(rows.delta_e, np.zeros(rows.delta_e.shape[1]), spec.states):
        command = displacement(rows.delta_a[index]) if robot.forces is None else force(rows.lambda_a[index])
        states.append(solve(problem, command))
    return mesh_error(scene, mesh, robot, scene_folder, [each for each in states if each.converged], spec)


def mesh_error_line(error: dict[str, Any]) -> str:
    """Line about what the mesh leaves uncertain within the range of the dataset."""
    if "left_out" in error:
        return f"discretisation error: not estimated ({error['left_out']})"
    low, high = (100 * share for share in error["tip"]["far"])
    return (
        f"discretisation error: where the effectors travel farthest, {low:.2g} to {high:.2g} % of their travel, up to "
        f"{length(error['tip_mm'], digits=2)}, and up to {error['force_percent']:.2g} % of the actuator forces "
        f"(rest and {counted(error['states'], 'state')} on {error['finer_cells']} instead of {error['cells']} cells, "
        f"{counted(error['factorizations'], 'factorisation')} there)"
    )
