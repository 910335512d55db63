"""The soft finger of Navez, Menager et al. 2025: three segments along -z, joined by hollow bellows, bending to +y."""

from math import tan

from cfem.robot.cad import Box, Difference, Frustum, Prism, Solid, Union
from cfem.robot.geometry import SoftFinger

# mm; not design parameters of the paper
BELLOW_OVERHANG = 6.0
BELLOW_HALF_LENGTH = 4.0
BELLOW_WALL = 3.5
CENTRE_WALL = 1.5
CORK = 4.0
FLANGE = 3.0


def soft_finger(spec: SoftFinger) -> Solid:
    """The solid, cavities left open inside it."""
    L, half = spec.segment_length, spec.thickness / 2
    joints = (-L, -2 * L)
    base = Box((-half, 0.0, -L / 2), (half, spec.height, 0.0))
    flange = Box((-half - FLANGE, 0.0, -FLANGE), (half + FLANGE, spec.height + FLANGE, 0.0))
    segments = tuple(_segment(spec, shift) for shift in (0.0, *joints))
    bellows = tuple(_bellow(half, z, wall=0.0) for z in joints)
    return Difference(Union((*segments, base, flange, *bellows)), tuple(cavity(spec, z) for z in joints))


def cavity(spec: SoftFinger, z: float) -> Solid:
    """The two chambers of the joint at z, either side of the centre wall."""
    whole = _bellow(spec.thickness / 2, z, wall=BELLOW_WALL)
    reach = spec.thickness
    walls = Box((-CENTRE_WALL, -reach, z - reach), (CENTRE_WALL, 2 * reach, z + reach))
    cork = Box((-2 * reach, -2 * reach, z - reach), (2 * reach, CORK, z + reach))
    return Difference(whole, (walls, cork))


def _segment(spec: SoftFinger, z: float) -> Solid:
    L, H, J = spec.segment_length, spec.height, spec.joint_height
    s = (H - J) * tan(spec.slope)
    outline = ((0.0, 0.0), (0.0, -L), (J, -L), (H, s - L), (H, -s), (J, 0.0))
    return Prism(tuple((y, along + z) for y, along in outline), -spec.thickness / 2, spec.thickness / 2)


def _bellow(half: float, z: float, wall: float) -> Solid:
    """A double cone about the z axis, widest in the joint's plane, its half y >= 0."""
    middle, end, reach = half + BELLOW_OVERHANG - wall, half - wall, 2 * (half + BELLOW_OVERHANG)
    cones = tuple(
        Frustum((0.0, 0.0, z), (0.0, 0.0, side), middle, end) for side in (BELLOW_HALF_LENGTH, -BELLOW_HALF_LENGTH)
    )
    behind = Box((-reach, -reach, z - reach), (reach, 0.0, z + reach))
    return Difference(Union(cones), (behind,))
