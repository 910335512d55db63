"""Equilibrium by other means than the solver's: from the body's internal forces and the constraints' gradients alone.

The unknowns are the positions of nodes that are neither held nor rigid, and of each rigid body the translation and the
rotation of its nodes about their mean; dual to them are the nodes' forces, and a rigid body's force and moment."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cfem.constraint.protocol import Watched
from cfem.equilibrium.system.robot import Robot
from cfem.mechanics.body import response


@dataclass(frozen=True)
class Forces:
    """Nodal forces (n_dof,) N: internal, constant external, and those of the constraints' multipliers."""

    internal: np.ndarray
    external: np.ndarray
    pulled: np.ndarray

    @property
    def residual(self) -> np.ndarray:
        return self.internal - self.external - self.pulled


def forces(robot: Robot, x: np.ndarray, lam: np.ndarray, load: float = 1.0) -> Forces:
    """Forces at positions x (n, 3) mm and multipliers lam of the active rows, with this share of the constant loads."""
    internal = response(robot.body, x).force
    external = np.zeros_like(x) if robot.loads is None else load * robot.loads
    return Forces(reduced(robot, x, internal), reduced(robot, x, external), gradients(robot, robot.active, x) @ lam)


def reduced(robot: Robot, x: np.ndarray, nodal: np.ndarray) -> np.ndarray:
    """Generalised forces (n_dof,) of nodal forces (n, 3): those of free nodes, then force and moment (N mm) of each
    rigid body."""
    parts = [nodal[_single(robot)].ravel()]
    for nodes in robot.rigid:
        arm = x[nodes] - x[nodes].mean(axis=0)
        parts += [nodal[nodes].sum(axis=0), np.cross(arm, nodal[nodes]).sum(axis=0)]
    return np.concatenate(parts)


def motion(robot: Robot, x: np.ndarray, nodal: np.ndarray) -> np.ndarray:
    """Generalised motion (n_dof,) of nodal motions (n, 3), dual to `reduced`: of a rigid body translation and rotation
    (fitted)."""
    parts = [nodal[_single(robot)].ravel()]
    for nodes in robot.rigid:
        arm, move = x[nodes] - x[nodes].mean(axis=0), nodal[nodes]
        spin = np.concatenate([np.cross(np.eye(3), lever).T for lever in arm])  # omega x arm, omega unknown
        turn = np.linalg.lstsq(spin, (move - move.mean(axis=0)).ravel(), rcond=None)[0]
        parts += [move.mean(axis=0), turn]
    return np.concatenate(parts)


def gradients(robot: Robot, rows: Sequence[Watched], x: np.ndarray) -> np.ndarray:
    """Gradients (n_dof, number of rows) of the values of `rows`."""
    columns = []
    for row in rows:
        for derivative in row.gradient(x):
            nodal = np.zeros_like(x)
            nodal[row.nodes] = derivative
            columns.append(reduced(robot, x, nodal))
    return np.stack(columns, axis=1) if columns else np.zeros((len(reduced(robot, x, np.zeros_like(x))), 0))


def force_scale(robot: Robot, forces: Forces) -> float:
    """Force, N, to compare with: the largest of internal, external and multipliers' forces, and of a strain of 1e-10
    over the whole body."""
    floor = 1e-10 * min(part.shear for part in robot.body.solids) * robot.body.mesh.size**2
    return max(floor, *(float(np.linalg.norm(part)) for part in (forces.internal, forces.external, forces.pulled)))


def strayed(robot: Robot, x: np.ndarray) -> float:
    """Largest motion of a held node, or change of a distance from the first node of a rigid body, over the size of the
    body."""
    X = robot.body.mesh.X
    moved = [np.abs(x - X)[robot.fixed].max(initial=0.0)]
    for nodes in robot.rigid:
        now, before = (np.linalg.norm(positions[nodes] - positions[nodes[0]], axis=1) for positions in (x, X))
        moved.append(np.abs(now - before).max())
    return float(max(moved) / robot.body.mesh.size)


def _single(robot: Robot) -> np.ndarray:
    alone = np.ones(len(robot.body.mesh.X), dtype=bool)
    alone[robot.fixed] = False
    for nodes in robot.rigid:
        alone[nodes] = False
    return alone
