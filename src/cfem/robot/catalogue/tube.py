"""A tube about the x axis, closed by plates: the body of a McKibben muscle under its braid."""

from typing import Literal

import numpy as np
from pydantic import Field

from cfem.core.spec import Spec
from cfem.core.units import Length
from cfem.robot.cad import Difference, Frustum, Solid


class Tube(Spec):
    """A tube along x from the origin, round about this axis, closed by a plate at each end, with one chamber. With a
    braid on its outside it is a McKibben muscle: `layers`."""

    kind: Literal["tube"]
    """A closed tube."""
    length: Length = Field(default=70.0, gt=0)
    """Length along x, plates included."""
    radius: Length = Field(default=8.0, gt=0)
    """Radius of its outside."""
    wall: Length = Field(default=1.5, gt=0)
    """Thickness of the wall."""
    plate: Length = Field(default=5.0, gt=0)
    """Thickness of each end plate."""

    def check(self) -> None:
        if self.wall >= self.radius or 2 * self.plate >= self.length:
            raise ValueError("the wall must be thinner than the radius, and two plates than the length")


def tube(spec: Tube) -> Solid:
    """The solid along x from x = 0; its chamber is left open inside it."""
    outer = Frustum((0.0, 0.0, 0.0), (spec.length, 0.0, 0.0), spec.radius, spec.radius)
    bore, room = spec.radius - spec.wall, spec.length - 2 * spec.plate
    return Difference(outer, (Frustum((spec.plate, 0.0, 0.0), (room, 0.0, 0.0), bore, bore),))


def tip(spec: Tube) -> np.ndarray:
    """Point (3,) mm at the free end, on the axis."""
    return np.array([spec.length, 0.0, 0.0])
