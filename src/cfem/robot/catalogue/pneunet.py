"""A PneuNet after Mosadegh et al., Adv. Funct. Mater. 24, 2014: cells with gaps between them on a common floor, and one
chamber of a room in each, joined by a duct."""

import numpy as np

from cfem.robot import geometry
from cfem.robot.cad import Box, Difference, Solid, Union


def pneunet(spec: geometry.PneuNet) -> Solid:
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


def length(spec: geometry.PneuNet) -> float:
    """Length mm along x."""
    return spec.cells * spec.cell_length + (spec.cells - 1) * spec.gap


def tip(spec: geometry.PneuNet) -> np.ndarray:
    """Point (3,) mm at the free end, in the middle of the floor."""
    return np.array([length(spec), 0.0, spec.floor / 2])
