"""The trunk of Menager et al., ICRA 2023, in a shape of our own: tapered, disks for the cables and necks that bend."""

from math import cos, pi, sin
from typing import Literal

import numpy as np
from pydantic import Field, PositiveInt

from cfem.core.spec import Spec
from cfem.core.units import Length
from cfem.robot.cad import Loft, Point, Solid, Union

SIDES = 8  # of every section; two of them face each way that a cable lies in
AT_BASE, AT_TIP = 10 / 26, 3.5 / 12  # of the width: a cable's distance from the axis


class Trunk(Spec):
    """A tapered trunk from z = 0 up. Necks join its disks (after Menager et al. 2023)."""

    kind: Literal["trunk"]
    """The trunk robot."""
    length: Length = Field(default=195.0, gt=0)
    """Length along z."""
    base_width: Length = Field(default=26.0, gt=0)
    """Width across flats at the base."""
    tip_width: Length = Field(default=12.0, gt=0)
    """Width across flats at the tip."""
    neck: float = Field(default=0.63, gt=0, le=1)
    """Width of a neck relative to that of a disk there."""
    disks: PositiveInt = 10
    """Number of disks."""
    pitch: Length = Field(default=17.5, gt=0)
    """Distance from disk to disk."""
    disk_thickness: Length = Field(default=6.0, gt=0)
    """Thickness of a disk. Smaller than pitch."""

    def check(self) -> None:
        if self.disk_thickness >= self.pitch or self.disks * self.pitch >= self.length:
            raise ValueError("disk_thickness must be smaller than pitch, and disks times pitch smaller than length")


def trunk(spec: Trunk) -> Solid:
    """Solid of the trunk from z = 0 up: a block, then necks and disks in turns, the last disk one with the block at the
    tip. The blocks share what the disks leave of the length."""
    block, neck = _block(spec), spec.pitch - spec.disk_thickness
    parts = [_piece(spec, 0.0, block, 1.0)]
    for low in (block + spec.pitch * disk for disk in range(spec.disks)):
        parts.append(_piece(spec, low, low + neck, spec.neck))
        parts.append(_piece(spec, low + neck, low + spec.pitch, 1.0))
    return Union((*parts, _piece(spec, spec.length - block, spec.length, 1.0)))


def _piece(spec: Trunk, low: float, high: float, share: float) -> Solid:
    """Piece of the tapered trunk between two heights, `share` as wide as the trunk there."""

    def section(z: float) -> tuple[Point, ...]:
        width = spec.base_width + (spec.tip_width - spec.base_width) * z / spec.length
        radius = share * width / 2 / cos(pi / SIDES)
        angles = [2 * pi * (corner + 0.5) / SIDES for corner in range(SIDES)]
        return tuple((radius * cos(angle), radius * sin(angle), z) for angle in angles)

    return Loft(section(low), section(high))


def _block(spec: Trunk) -> float:
    return (spec.length - spec.disks * spec.pitch) / 2


def route(spec: Trunk, side: np.ndarray) -> np.ndarray:
    """Points (2 disks, 3) mm of a cable along the side in this direction (3,): two points in each disk, a sixth of its
    thickness from its middle plane."""
    z, away = _passages(spec)
    published = _passages(Trunk(kind="trunk"))[1]
    shared = min(len(away), len(published))
    away[:shared] += (np.round(published, 4) - published)[:shared]  # the published robot's are stated to 0.1 um
    return np.outer(away, side) + np.outer(z, [0.0, 0.0, 1.0])


def _passages(spec: Trunk) -> tuple[np.ndarray, np.ndarray]:
    """Heights and distances from the axis, (2 disks,) mm each, of the points of a cable."""
    middle = _block(spec) + spec.pitch * np.arange(1, spec.disks + 1) - spec.disk_thickness / 2
    z = (middle[:, None] + spec.disk_thickness / 6 * np.array([-1.0, 1.0])).ravel()
    share = z / spec.length
    return z, AT_BASE * spec.base_width * (1 - share) + AT_TIP * spec.tip_width * share


def pull_point(spec: Trunk, side: np.ndarray) -> np.ndarray:
    """Point (3,) mm in the plane of the base from which the cable along a side is pulled."""
    return AT_BASE * spec.base_width * side


def tip(spec: Trunk) -> np.ndarray:
    """Middle (3,) mm of the face at the free end."""
    return np.array([0.0, 0.0, spec.length])
