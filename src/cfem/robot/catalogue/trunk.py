"""The trunk of Menager et al., ICRA 2023, in a shape of our own: tapered, disks for the cables and necks that bend."""

from math import cos, pi, sin

from cfem.robot.cad import Loft, Point, Solid, Union
from cfem.robot.geometry import Trunk

SIDES = 8  # of every section; two of them face each way that a cable lies in


def trunk(spec: Trunk) -> Solid:
    """From the base at z = 0 up: a block, then a neck and a disk in turns, the last disk one with the block at the
    tip. The blocks share what the disks leave of the length."""
    block = (spec.length - spec.disks * spec.pitch) / 2
    neck = spec.pitch - spec.disk_thickness
    parts = [_piece(spec, 0.0, block, 1.0)]
    for low in (block + spec.pitch * disk for disk in range(spec.disks)):
        parts.append(_piece(spec, low, low + neck, spec.neck))
        parts.append(_piece(spec, low + neck, low + spec.pitch, 1.0))
    return Union((*parts, _piece(spec, spec.length - block, spec.length, 1.0)))


def _piece(spec: Trunk, low: float, high: float, share: float) -> Solid:
    """Of the tapered trunk between two heights, `share` as wide as it is."""

    def section(z: float) -> tuple[Point, ...]:
        width = spec.base_width + (spec.tip_width - spec.base_width) * z / spec.length
        radius = share * width / 2 / cos(pi / SIDES)
        angles = [2 * pi * (corner + 0.5) / SIDES for corner in range(SIDES)]
        return tuple((radius * cos(angle), radius * sin(angle), z) for angle in angles)

    return Loft(section(low), section(high))
