"""A PneuNet after Mosadegh et al., Adv. Funct. Mater. 24, 2014: cells with gaps between them on a common floor, and one
chamber of a room in each, joined by a duct."""

from typing import Literal

import numpy as np
from pydantic import Field, PositiveInt

from cfem.core.spec import Spec
from cfem.core.units import Length
from cfem.robot.cad import Box, Difference, Solid, Union


class PneuNet(Spec):
    """Cells in a row along x from the origin with gaps between them, on a common floor from z = 0 up, with one chamber:
    a room in each cell, joined by a duct through the floor (after Mosadegh et al. 2014). A layer on the floor that does
    not stretch makes it bend: `layers`."""

    kind: Literal["pneunet"]
    """A PneuNet."""
    cells: PositiveInt = 5
    """Number of cells."""
    cell_length: Length = Field(default=10.0, gt=0)
    """Length of a cell along x, walls included."""
    gap: Length = Field(default=1.5, gt=0)
    """Distance from cell to cell."""
    width: Length = Field(default=15.0, gt=0)
    """Width along y."""
    height: Length = Field(default=18.0, gt=0)
    """Height along z, floor included."""
    wall: Length = Field(default=1.5, gt=0)
    """Thickness of the walls and the roof of a room."""
    floor: Length = Field(default=3.0, gt=0)
    """Thickness of the floor below the rooms."""
    duct: Length = Field(default=2.0, gt=0)
    """Width and height of the duct."""

    def check(self) -> None:
        if 2 * self.wall >= min(self.cell_length, self.width) or self.floor + self.duct + self.wall >= self.height:
            what = "2 wall must be smaller than cell_length and width, and floor, duct and wall together than height"
            raise ValueError(what)
        if self.duct >= self.width - 2 * self.wall:
            raise ValueError("the duct must be narrower than a room")


def pneunet(spec: PneuNet) -> Solid:
    """The solid along x from x = 0, symmetric about y = 0, from z = 0 up; its chamber is left open inside it."""
    half, low = spec.width / 2, spec.floor
    slab = Box((0.0, -half, 0.0), (length(spec), half, low + spec.duct + spec.wall))
    starts = [cell * (spec.cell_length + spec.gap) for cell in range(spec.cells)]
    cells = [Box((x, -half, 0.0), (x + spec.cell_length, half, spec.height)) for x in starts]
    room = (half - spec.wall, spec.height - spec.wall)
    rooms = [Box((x + spec.wall, -room[0], low), (x + spec.cell_length - spec.wall, room[0], room[1])) for x in starts]
    ends = spec.wall, length(spec) - spec.wall
    duct = Box((ends[0], -spec.duct / 2, low), (ends[1], spec.duct / 2, low + spec.duct))
    return Difference(Union((slab, *cells)), (Union((duct, *rooms)),))


def length(spec: PneuNet) -> float:
    """Length mm along x."""
    return spec.cells * spec.cell_length + (spec.cells - 1) * spec.gap


def tip(spec: PneuNet) -> np.ndarray:
    """Point (3,) mm at the free end, in the middle of the floor."""
    return np.array([length(spec), 0.0, spec.floor / 2])
