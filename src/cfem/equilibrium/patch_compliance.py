"""How patches of a body's surface yield to forces: rows of contact, and what the modes of a skin, or the pose of a
rigid patch, leave of them."""

from dataclasses import replace

import numpy as np

from cfem.condensed.patches import Patches
from cfem.condensed.pose import Patch
from cfem.constraint.attachment import Attachment
from cfem.constraint.contact import ContactPoint
from cfem.core.errors import NumericalError
from cfem.equilibrium.actuation import displacement
from cfem.equilibrium.held_patch import held
from cfem.equilibrium.problem import Problem
from cfem.equilibrium.robot import Robot
from cfem.equilibrium.solve import solve


def with_patches(robot: Robot, nodes: np.ndarray, patches: Patches, chosen: np.ndarray) -> Robot:
    """The robot with the `chosen` patches (numbers) for contact points; nodes (m,): of the surface in the mesh."""
    points = []
    for number in chosen:
        mine = patches.members[number]
        order = np.argsort(nodes[mine])
        point = Attachment(nodes[mine][order], patches.shares[mine][order], patches.rest[number])
        points.append(ContactPoint(point))
    names = tuple(f"patch-{number}.{axis}" for number in chosen for axis in "xyz")
    return replace(robot, contacts=tuple(points), rows=replace(robot.rows, contacts=names))


def patch_compliance(robot: Robot, nodes: np.ndarray, patches: Patches, states: np.ndarray) -> np.ndarray:
    """(J, 3 N, 3 N) mm/N: how the patches yield to forces on them, actuators held at states (J, n_a) mm.

    One equilibrium and one block of right-hand sides a state. NumericalError where there is no equilibrium."""
    touched = with_patches(robot, nodes, patches, np.arange(len(patches)))
    plain, problem, rows = Problem(robot), Problem(touched), touched.rows
    found, start = np.empty((len(states), rows.n_c, rows.n_c)), None
    for j, delta in enumerate(states):
        moved = solve(plain, displacement(delta), base=start, slack=False)
        if not moved.converged:
            raise NumericalError(f"patches of the surface: {moved.status.value}")
        start = moved.state
        lam = np.concatenate([start.lam, np.zeros(rows.n_c)])
        held = solve(problem, displacement(delta), start=replace(start, lam=lam), slack=False)
        if not held.converged:
            raise NumericalError(f"patches of the surface: {held.status.value}")
        W = held.condensed.W
        across = W[rows.c, rows.a]
        G = np.linalg.solve(W[rows.a, rows.a], across.T).T
        found[j] = W[rows.c, rows.c] - G @ across.T
    return found


def within_patch(robot: Robot, patch: Patch) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """How the contact points yield, at rest, to forces that are in balance within their patch: shapes (3 k, n) of
    displacement, n = 3 k - 6, the compliance (n, n) mm/N by their sizes, and those sizes by the actuators (n, n_a).

    W of the points is J C J^T + N D N^T, C of the rigid patch: with Q the forces in balance, J^T Q = 0, N is W Q and D
    the inverse of Q^T W Q; N is scaled to unit length here."""
    rest = solve(Problem(robot), held(displacement(np.zeros(robot.rows.n_a)), np.zeros(robot.rows.n_c)), slack=False)
    if not rest.converged:
        raise NumericalError(f"contact points at rest: {rest.status.value}")
    rows, whole = rest.condensed.rows, rest.condensed.W
    moved = np.linalg.solve(whole[rows.a, rows.a], whole[rows.a, rows.c]).T
    W = whole[rows.c, rows.c] - moved @ whole[rows.a, rows.c]
    J = patch.jacobian(np.zeros(6))
    Q = np.linalg.svd(J.T)[2][6:].T
    N = W @ Q
    size = np.linalg.norm(N, axis=0)
    D = np.linalg.inv(Q.T @ N)
    N = N / size
    follows = np.linalg.solve(np.hstack([J, N]), moved)[6:]
    return N, size[:, None] * (D + D.T) / 2 * size, follows
