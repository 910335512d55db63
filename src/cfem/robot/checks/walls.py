"""Walls of chambers that elements are too poor for."""

import numpy as np

from cfem.constraint.cavity import Cavity
from cfem.equilibrium.system.robot import Robot

POOR = {"tet4": "which cannot bend", "tet10": "which locks in thin walls"}
_MOST = 0.5  # of the cells at a chamber's wall: beyond, the wall is one cell thick


def wall_doubts(scene, robot: Robot) -> list[str]:
    """Sentences on chambers whose walls are one cell thick, of an element that cannot bend there."""
    why, doubts = POOR.get(scene.mesh.element), []
    for item, actuator in zip(scene.actuators, robot.actuators, strict=True) if why else ():
        if not isinstance(actuator, Cavity):
            continue
        share = through_the_wall(robot.body.mesh.cells, robot.body.mesh.facets, actuator.nodes)
        if share > _MOST:
            what = f"{100 * share:.0f} % of the cells at the wall of chamber '{item.name}' reach through it"
            doubts.append(f"{what}, and are {scene.mesh.element}, {why}: the chamber comes out too stiff; use tet10p0")
    return doubts


def through_the_wall(cells: np.ndarray, facets: np.ndarray, chamber: np.ndarray) -> float:
    """Share of the tetrahedra (m, 4 | 10) with a face on a chamber, its nodes (k,), that reach to the other side of its
    wall: whose corners all lie on the surface, its facets (f, 3 | 6)."""
    corners = cells[:, :4]
    at_wall = np.isin(corners, chamber).sum(axis=1) >= 3
    through = np.isin(corners, np.unique(facets)).all(axis=1)
    return float((at_wall & through).sum() / max(at_wall.sum(), 1))
