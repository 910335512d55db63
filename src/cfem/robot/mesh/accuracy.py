"""The mesh that has the error which a scene allows: mesh, estimate, refine.

Its error is known by the same commands on eight times as many cells, which takes most of the time. So the indicator by
which meshes are graded foretells the error of a further mesh from that of the last one, and only a mesh that should
have the error is compared with a finer one."""

from math import ceil
from pathlib import Path
from typing import Any

import numpy as np

from cfem.condensed.mesh_error import mesh_error_of
from cfem.core.console.progress import doing
from cfem.core.errors import NumericalError
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import Actuation, force, pull
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.robot import Robot
from cfem.equilibrium.system.solution import Equilibrium
from cfem.mechanics.mesh import Mesh
from cfem.robot.build import build_robot
from cfem.robot.mesh.error import chosen, mesh_error
from cfem.robot.mesh.error_spec import MeshErrorSpec
from cfem.robot.mesh.finer import dimensions
from cfem.robot.mesh.grading import estimate, graded_mesh
from cfem.robot.spec import SceneSpec

ROUNDS = 5
FIRST = 500  # cells
STATES = 2
# Cells by a power of the error: h^2 with cells h^-3, and a little more than that, as notches converge more slowly.
_POWER, _MORE, _MOST = 1.5, 1.2, 8.0


def accurate_mesh(scene: SceneSpec, folder: Path) -> tuple[Mesh, float | None, dict[str, Any]]:
    """Mesh and CAD volume of a scene, and its `mesh_error`, whose upper bound is at most `mesh.accuracy` of how far the
    effectors travel. NumericalError where no mesh that was tried has it, or its error cannot be estimated."""
    allowed, cells, left, spec = scene.mesh.accuracy, FIRST, "", MeshErrorSpec(states=STATES)
    by_indicator = 0.0  # error over what `grading.estimate` says, of the last mesh that was compared with a finer one
    for number in range(1, ROUNDS + 1):
        doing(f"meshing to an error of {100 * allowed:.2g} %, round {number}")
        meshing = scene.mesh.model_copy(update={"accuracy": None, "cells": cells})
        mesh, volume = graded_mesh(scene.model_copy(update={"mesh": meshing}), folder)
        robot = build_robot(scene, mesh)
        indicated = float(estimate(robot).squared.sum())
        share, leave = by_indicator * indicated, "would leave about"
        if share <= allowed:
            stated = mesh_error(scene, mesh, robot, folder, at_reach(robot), spec, coarsest=np.inf)
            error = mesh_error_of(stated)
            if error is None:
                left = f"the error of {len(mesh.cells)} cells is not known: {stated['left_out']}"
                break
            if error.tip.highest <= allowed:
                return mesh, volume, stated
            share, leave, by_indicator = error.tip.highest, "leave", error.tip.highest / indicated
        left = f"{len(mesh.cells)} cells {leave} {100 * share:.2g} %"
        needed = (share / allowed) ** _POWER * len(mesh.cells)
        most = spec.largest // 2 ** dimensions(scene)
        if number > 1 and needed > most:
            enough = f"some {round(needed, -2):.0f} would be needed"
            left += f"; {enough}, and more than {most} cannot be compared with finer ones"
            break
        cells = min(ceil(min(_MORE * needed, _MOST * len(mesh.cells))), most)
    what = f"no mesh with an error of {100 * allowed:.2g} % was found: {left}"
    raise NumericalError(what, where="mesh.accuracy", do="allow a larger error, or give the guides of cables a radius")


def at_reach(robot: Robot) -> list[Equilibrium]:
    """States of single actuators at their reach: those in which the effectors travel farthest, by the compliance at
    rest."""
    problem = Problem(robot)
    n_a = robot.rows.n_a
    rows = robot.rows.e, robot.rows.a
    W = solve(problem, force(np.zeros(n_a))).condensed.W
    alone = W[rows] * (robot.reach[:, 1] / np.diag(W[rows[1], rows[1]]))
    farthest = chosen(alone.T, np.zeros(len(alone)), STATES)
    states = [solve(problem, _command(robot, index)) for index in farthest]
    return [state for state in states if state.converged]


def _command(robot: Robot, index: int) -> Actuation:
    """One actuator alone at its reach, or at its largest pressure where the scene states these."""
    share = np.eye(robot.rows.n_a)[index]
    return pull(share, robot.reach[:, 1]) if robot.forces is None else force(share * robot.forces[:, 1])


def scene_mesh(scene: SceneSpec, folder: Path) -> tuple[Mesh, float | None, dict[str, Any] | None]:
    """The scene's mesh, its CAD volume mm^3 (meshing.make_mesh) and its `mesh_error`, graded where the scene states a
    number of cells or the error that it may have; an error that was not asked for is None."""
    return accurate_mesh(scene, folder) if scene.mesh.accuracy is not None else (*graded_mesh(scene, folder), None)
