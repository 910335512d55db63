"""A trunk of four PneuNets about the x axis: square cells with gaps between them on a common spine, and four chambers
of a room in each cell, joined by ducts through the spine."""

from math import sqrt

import numpy as np

from cfem.robot import geometry
from cfem.robot.cad import Box, Difference, Prism, Solid, Union


def pneunet_trunk(spec: geometry.PneuNetTrunk) -> Solid:
    """The solid along x from x = 0; its chambers are left open inside it."""
    half, spine, end = spec.width / 2, spec.core + spec.duct + spec.wall, length(spec)
    starts = [cell * (spec.cell_length + spec.gap) for cell in range(spec.cells)]
    cells = [Box((x, -half, -half), (x + spec.cell_length, half, half)) for x in starts]
    rooms = [
        Prism(section, x + spec.wall, x + spec.cell_length - spec.wall)
        for x in starts
        for section in _sections(spec, half - spec.wall)
    ]
    ducts = [Prism(section, spec.wall, end - spec.wall) for section in _sections(spec, spec.core + spec.duct)]
    return Difference(Union((Box((0.0, -spine, -spine), (end, spine, spine)), *cells)), (Union((*ducts, *rooms)),))


def length(spec: geometry.PneuNetTrunk) -> float:
    """Length mm along x."""
    return spec.cells * spec.cell_length + (spec.cells - 1) * spec.gap


def tip(spec: geometry.PneuNetTrunk) -> np.ndarray:
    """Middle (3,) mm of the face at the free end."""
    return np.array([length(spec), 0.0, 0.0])


def _sections(spec: geometry.PneuNetTrunk, out: float) -> list[tuple[tuple[float, float], ...]]:
    """Corners (y, z) of the four chambers between the distances `core` and `out` from the axis: trapezoids that leave a
    wall along the diagonals."""
    aside = spec.wall / sqrt(2)
    corners = [(spec.core, aside - spec.core), (out, aside - out), (out, out - aside), (spec.core, spec.core - aside)]
    sections = []
    for _ in range(4):
        sections.append(tuple(corners))
        corners = [(-z, y) for y, z in corners]
    return sections
