"""The diamond of Menager et al., ICRA 2023, in a shape of our own: four legs with knees from a base to a platform."""

from math import atan2, cos, pi, sin, tan
from typing import Literal

import numpy as np
from pydantic import Field

from cfem.core.spec import Spec
from cfem.core.units import Length
from cfem.robot.cad import Box, Placed, Prism, Solid, Union

# mm; not parameters: where the base stands, what joins the legs, the flat outer side of a knee, the length of a hinge
BOTTOM = -37.0
BASE_TOP = 10.0
PLATFORM = 16.0
KNEE_FACE = 12.0
HINGE = 14.0
PULLED = 67 / 163  # of the height: where the cables are pulled from, a third of the width off the axis


class Diamond(Spec):
    """Four legs with knees, from a base up to a platform (after Menager et al. 2023)."""

    kind: Literal["diamond"]
    """The diamond robot."""
    width: Length = Field(default=30.0, gt=0)
    """Width of base, legs and platform."""
    leg_thickness: Length = Field(default=13.5, gt=0)
    """Thickness of a leg."""
    hinge_thickness: Length = Field(default=9.0, gt=0)
    """Thickness of a leg at its root. Smaller than leg_thickness."""
    knee_distance: Length = Field(default=97.0, gt=0)
    """Distance of the knees' outer sides from the z axis."""
    height: Length = Field(default=163.0, gt=0)
    """Height of the whole robot, from z = -37 mm up."""

    def check(self) -> None:
        if self.hinge_thickness >= self.leg_thickness:
            raise ValueError("hinge_thickness must be smaller than leg_thickness")


def diamond(spec: Diamond) -> Solid:
    """The base and the platform about the z axis, one leg towards +y and its copies by quarter turns."""
    half, top = spec.width / 2, BOTTOM + spec.height
    base = Box((-half, -half, BOTTOM), (half, half, BASE_TOP))
    platform = Box((-half, -half, top - PLATFORM), (half, half, top))
    leg = _leg(spec)
    turned = tuple(Placed(leg, (0.0, 0.0, 1.0), quarter * pi / 2, (0.0, 0.0, 0.0)) for quarter in (1, 2, 3))
    return Union((base, platform, leg, *turned))


def _leg(spec: Diamond) -> Solid:
    """Two links of even thickness that meet in a knee at half height; the lower one begins with a thinner hinge, for a
    link that bends all along under the pull of its cable is near to buckling."""
    half, knee, low, high = spec.width / 2, spec.knee_distance, BOTTOM, BOTTOM + spec.height
    middle, face = (low + high) / 2, KNEE_FACE / 2
    slope = atan2(middle - face - low, knee - half)
    thick, thin = spec.leg_thickness, spec.hinge_thickness

    def link(along: float, inwards: float) -> tuple[float, float]:
        """A point (y, z) of the lower link, from the foot of its outer side."""
        return half + along * cos(slope) - inwards * sin(slope), low + along * sin(slope) + inwards * cos(slope)

    wall, end = thin * tan(slope), thin * tan(slope) + HINGE
    hinge = (link(end + thick - thin, thick), link(end, thin), link(wall, thin))
    inner = (half + (middle - low - thick / cos(slope)) / tan(slope), middle)
    outside = ((half, low), (knee, middle - face), (knee, middle + face), (half, high))
    return Prism((*outside, (half, high - thick / cos(slope)), inner, *hinge), -half, half)


def route(spec: Diamond, side: np.ndarray) -> np.ndarray:
    """Point (1, 3) mm where a cable is held, in the outer side of the knee in this direction (3,)."""
    return (spec.knee_distance * side + [0.0, 0.0, BOTTOM + spec.height / 2 + KNEE_FACE / 24])[None]


def pull_point(spec: Diamond, side: np.ndarray) -> np.ndarray:
    """Point (3,) mm between base and platform from which the cable of a side is pulled."""
    return spec.width / 3 * side + [0.0, 0.0, BOTTOM + PULLED * spec.height]


def tip(spec: Diamond) -> np.ndarray:
    """Point (3,) mm of the platform, just below its top."""
    return np.array([0.0, 0.0, BOTTOM + spec.height - PLATFORM / 16])
