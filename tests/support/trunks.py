"""Tapered trunks whose cables oppose each other, from a structured mesh."""

import numpy as np

from cfem.condensed import Rows
from cfem.constraint.attachment import attach
from cfem.constraint.cable import make_cable
from cfem.constraint.effector import make_effector
from cfem.equilibrium.system.robot import Robot
from cfem.mechanics.body import make_body
from cfem.mechanics.element import ELEMENTS
from cfem.mechanics.mass import gravity
from cfem.mechanics.material import LAWS
from cfem.mechanics.material.law import Material
from cfem.mechanics.mesh import Mesh, quadratic
from support.blocks import block

LENGTH, BASE, TIP = 195.0, 13.0, 6.0  # mm: along z, and half the side of its square sections


def trunk(cables: int, divisions: int = 10, reach: float = 10.0, weight: float = 0.0) -> Robot:
    """A trunk along z that is held at z = 0, with `cables` spread evenly about its axis, at 0.7 of half the side.

    divisions: cubes along it; reach: mm of each cable; weight: N, across it."""
    straight = block((2.0, 2.0, LENGTH), (2, 2, divisions))
    corners = straight.X - [1.0, 1.0, 0.0]
    corners[:, :2] *= half_side(corners[:, 2])[:, None]
    mesh = Mesh(*quadratic(corners, straight.cells, straight.facets))
    body = make_body(mesh, ELEMENTS["tet10p0"], Material(LAWS["neo-hookean-log"], 0.45, 0.45))
    names = tuple(f"cable-{number}" for number in range(cables))
    actuators = []
    for number, name in enumerate(names):
        angle = 2 * np.pi * (number + 0.25) / cables
        along = 0.7 * np.array([np.cos(angle), np.sin(angle)])
        heights = np.linspace(0.0, 0.95 * LENGTH, 8)
        route = np.column_stack([half_side(heights)[:, None] * along, heights])
        points = [attach(mesh, point, 0.0, name) for point in route[1:]]
        actuators.append(make_cable(points, route[0], name))
    return Robot(
        name=f"trunk-{cables}",
        body=body,
        fixed=np.flatnonzero(mesh.X[:, 2] < 1e-9),
        actuators=tuple(actuators),
        effectors=(make_effector(mesh, np.array([0.0, 0.0, LENGTH]), 0.0, 10.0, "tip"),),
        rows=Rows(("tip.x", "tip.y", "tip.z"), names),
        reach=np.tile([0.0, reach], (cables, 1)),
        unilateral=np.ones(cables, dtype=bool),
        length=LENGTH,
        loads=gravity(body, weight / body.mesh.volumes.sum(), np.array([1.0, 0.0, 0.0])) if weight else None,
    )


def half_side(z: np.ndarray) -> np.ndarray:
    return BASE + (TIP - BASE) * z / LENGTH
