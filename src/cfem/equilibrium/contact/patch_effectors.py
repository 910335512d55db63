"""Patches of the surface that bear loads, as further effectors of a robot, and how they and the others yield."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cfem.constraint.attachment import Attachment
from cfem.constraint.effector import PointEffector
from cfem.constraint.patch import PatchLoad
from cfem.constraint.surface import outer_surface
from cfem.core.console.progress import progress
from cfem.core.errors import NumericalError
from cfem.equilibrium.solve import Wanted, solve
from cfem.equilibrium.system.actuation import displacement
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.robot import Robot, demand_without_discrepancy


def with_patches(robot: Robot, patches: Sequence[PatchLoad]) -> Robot:
    """The robot with the places of the patches behind its effectors. SpecError where one is not on the surface."""
    if not patches:
        return robot
    demand_without_discrepancy(robot, "patches of the surface")
    surface, points = outer_surface(robot.X, robot.body.mesh.facets), []
    for patch in patches:
        shares = patch.shares(surface.rest, surface.triangles, surface.weights)
        mine = np.flatnonzero(shares)
        point = Attachment(surface.nodes[mine], shares[mine], shares @ surface.rest)
        points.append(PointEffector(point))
    names = tuple(f"patch-{number}.{axis}" for number in range(len(patches)) for axis in "xyz")
    rows = replace(robot.rows, effectors=robot.rows.effectors + names)
    return replace(robot, effectors=(*robot.effectors, *points), rows=rows)


@dataclass(frozen=True)
class PatchYield:
    """Response of patches at states (J, n_a) mm of a robot without these loads, actuators held.

    e: (J, 3 P) mm, displacements of the patches
    C: (J, r, r) mm/N, compliance of effectors and patches
    D: (J, r, r, r) mm/N^2, change of C with forces on them"""

    states: np.ndarray
    e: np.ndarray
    C: np.ndarray
    D: np.ndarray


def patch_yield(robot: Robot, patches: Sequence[PatchLoad], states: np.ndarray) -> PatchYield:
    """Response of the patches at states (J, n_a) mm: one equilibrium each, from near rest on, no further factorisation.
    NumericalError where there is none."""
    states = states[np.argsort(np.linalg.norm(states, axis=1))]
    problem, n_e, start, columns = Problem(with_patches(robot, patches)), robot.rows.n_e, None, []
    with progress("FE states under a force on the surface", len(states)) as advance:
        for delta in states:
            solved = solve(problem, displacement(delta), start, slack=False, wanted=Wanted(loads=True))
            if not solved.converged:
                raise NumericalError(f"patches under loads: {solved.status.value}")
            start, condensed = solved.state, solved.condensed
            C = condensed.W[condensed.rows.e, condensed.rows.e] - condensed.W_ea @ np.linalg.solve(
                condensed.W_aa, condensed.W_ea.T
            )  # contacts free
            columns.append((solved.delta_e[n_e:], C, solved.dC))
            advance(1)
    return PatchYield(states, *(np.stack(each) for each in zip(*columns, strict=True)))
