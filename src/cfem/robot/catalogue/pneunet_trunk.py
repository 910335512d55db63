"""A trunk of four PneuNets about the x axis: square cells with gaps between them on a common spine, and four chambers
of a room in each cell, joined by ducts through the spine."""

from math import sqrt
from typing import Literal

import numpy as np
from pydantic import Field, PositiveInt

from cfem.core.spec import Spec
from cfem.core.units import Length
from cfem.robot.cad import Box, Difference, Prism, Solid, Union


class PneuNetTrunk(Spec):
    """Square cells in a row along x from the origin with gaps between them, on a common spine, with four chambers on
    the sides y+, z+, y- and z-: a room of each in every cell, joined by ducts through the spine. Cells that are blown
    up push their neighbours: `self_contact`."""

    kind: Literal["pneunet-trunk"]
    """A trunk of four PneuNets."""
    cells: PositiveInt = 2
    """Number of cells."""
    cell_length: Length = Field(default=8.0, gt=0)
    """Length of a cell along x, walls included."""
    gap: Length = Field(default=1.0, gt=0)
    """Distance from cell to cell."""
    width: Length = Field(default=30.0, gt=0)
    """Width of a cell along y, and along z."""
    wall: Length = Field(default=1.5, gt=0)
    """Thickness of the walls around rooms and ducts, and between chambers."""
    core: Length = Field(default=2.5, gt=0)
    """Distance of the chambers from the axis."""
    duct: Length = Field(default=2.0, gt=0)
    """Height of a duct, away from the axis."""

    def check(self) -> None:
        if 2 * self.wall >= self.cell_length or 2 * (self.core + self.duct + self.wall) >= self.width:
            raise ValueError("2 wall must be smaller than cell_length, and core, duct and wall together than width / 2")
        if self.wall >= self.core:
            raise ValueError("the core must be larger than the wall, which the chambers leave between them")


def pneunet_trunk(spec: PneuNetTrunk) -> Solid:
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


def length(spec: PneuNetTrunk) -> float:
    """Length mm along x."""
    return spec.cells * spec.cell_length + (spec.cells - 1) * spec.gap


def tip(spec: PneuNetTrunk) -> np.ndarray:
    """Middle (3,) mm of the face at the free end."""
    return np.array([length(spec), 0.0, 0.0])


def _sections(spec: PneuNetTrunk, out: float) -> list[tuple[tuple[float, float], ...]]:
    """Corners (y, z) of the four chambers between the distances `core` and `out` from the axis: trapezoids that leave a
    wall along the diagonals."""
    aside = spec.wall / sqrt(2)
    corners = [(spec.core, aside - spec.core), (out, aside - out), (out, out - aside), (spec.core, spec.core - aside)]
    sections = []
    for _ in range(4):
        sections.append(tuple(corners))
        corners = [(-z, y) for y, z in corners]
    return sections
