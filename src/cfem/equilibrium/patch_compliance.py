"""How patches of a body's surface yield to forces: rows of contact, and what the modes of a skin leave of them."""

from dataclasses import replace

import numpy as np

from cfem.condensed.patches import Patches
from cfem.constraint.attachment import Attachment
from cfem.constraint.contact import ContactPoint
from cfem.core.errors import NumericalError
from cfem.equilibrium.actuation import displacement
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
