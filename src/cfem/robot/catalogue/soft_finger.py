"""The soft finger of Navez, Menager et al. 2025: three segments along -z, joined by hollow bellows, bending to +y."""

from math import pi, tan
from typing import Literal

import numpy as np
from pydantic import Field

from cfem.core.spec import Spec
from cfem.core.units import Angle, Length
from cfem.robot.cad import Box, Difference, Frustum, Prism, Solid, Union

# mm; not design parameters of the paper
BELLOW_OVERHANG = 6.0
BELLOW_HALF_LENGTH = 4.0
FLANGE = 3.0


class SoftFinger(Spec):
    """Three segments joined by bellows with passive cavities (Navez, Menager et al. 2025). Defaults are the paper's."""

    kind: Literal["soft-finger"]
    """The soft finger of the paper."""
    segment_length: Length = Field(default=40.0, gt=0)
    """Length of each segment."""
    height: Length = Field(default=20.0, gt=0)
    """Height of a segment."""
    joint_height: Length = Field(default=6.0, gt=0)
    """Height of the joint between two segments."""
    thickness: Length = Field(default=17.5, gt=0)
    """Thickness of the finger."""
    slope: Angle = Field(default=pi / 4, gt=0, lt=pi / 2)
    """Angle of the sloped faces of a bellow."""
    plateau: Length = Field(default=0.0, ge=0, lt=8)
    """Length over which a bellow has its largest radius."""
    wall: Length = Field(default=3.5, gt=0)
    """Thickness of a bellow's wall around its cavity."""
    centre_wall: Length = Field(default=3.0, ge=0)
    """Thickness of the wall between the two halves of a cavity; 0 for one cavity."""
    cork: Length = Field(default=4.0, ge=0)
    """Height from y = 0 up to which the cavity is filled."""


def soft_finger(spec: SoftFinger) -> Solid:
    """The solid, cavities left open inside it."""
    L, half = spec.segment_length, spec.thickness / 2
    joints = (-L, -2 * L)
    base = Box((-half, 0.0, -L / 2), (half, spec.height, 0.0))
    flange = Box((-half - FLANGE, 0.0, -FLANGE), (half + FLANGE, spec.height + FLANGE, 0.0))
    segments = tuple(_segment(spec, shift) for shift in (0.0, *joints))
    bellows = tuple(_bellow(spec, z, wall=0.0) for z in joints)
    return Difference(Union((*segments, base, flange, *bellows)), tuple(cavity(spec, z) for z in joints))


def cavity(spec: SoftFinger, z: float) -> Solid:
    """Void of the joint at z, either side of the centre wall if there is one."""
    bellow, reach = _bellow(spec, z, spec.wall), spec.thickness
    cork = Box((-2 * reach, -2 * reach, z - reach), (2 * reach, spec.cork, z + reach))
    if not spec.centre_wall:
        return Difference(bellow, (cork,))
    half = spec.centre_wall / 2
    return Difference(bellow, (Box((-half, -reach, z - reach), (half, 2 * reach, z + reach)), cork))


def route(spec: SoftFinger, x: float, y: float) -> np.ndarray:
    """Points (6, 3) mm where the line at x and y meets the sloped faces, from the base to the tip."""
    s = (y - spec.joint_height) * tan(spec.slope)
    L = spec.segment_length
    return np.array([(x, y, -z) for i in range(3) for z in (L * i + s, L * (i + 1) - s)])


def tip(spec: SoftFinger) -> np.ndarray:
    """Middle (3,) mm of the face at the free end."""
    return np.array([0.0, spec.height / 2, -3 * spec.segment_length])


def _segment(spec: SoftFinger, z: float) -> Solid:
    L, H, J = spec.segment_length, spec.height, spec.joint_height
    s = (H - J) * tan(spec.slope)
    outline = ((0.0, 0.0), (0.0, -L), (J, -L), (H, s - L), (H, -s), (J, 0.0))
    return Prism(tuple((y, along + z) for y, along in outline), -spec.thickness / 2, spec.thickness / 2)


def _bellow(spec: SoftFinger, z: float, wall: float) -> Solid:
    """Half y >= 0 of a bellow around the z axis, widest about the joint's plane."""
    half, flat = spec.thickness / 2, spec.plateau / 2
    middle, end, reach = half + BELLOW_OVERHANG - wall, half - wall, 2 * (half + BELLOW_OVERHANG)
    parts = [
        Frustum((0.0, 0.0, z + side * flat), (0.0, 0.0, side * (BELLOW_HALF_LENGTH - flat)), middle, end)
        for side in (1.0, -1.0)
    ]
    if flat:
        parts.append(Frustum((0.0, 0.0, z - flat), (0.0, 0.0, 2 * flat), middle, middle))
    behind = Box((-reach, -reach, z - reach), (reach, 0.0, z + reach))
    return Difference(Union(tuple(parts)), (behind,))
