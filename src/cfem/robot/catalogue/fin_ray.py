"""A Fin Ray finger after Kniese and Festo: two walls that meet at the tip, joined by ribs."""

from math import cos, hypot, pi, tan
from typing import Literal

import numpy as np
from pydantic import Field, PositiveInt

from cfem.core.spec import Spec
from cfem.core.units import Angle, Length
from cfem.robot.cad import Difference, Loft, Solid

Corner = tuple[float, float]


class FinRay(Spec):
    """A Fin Ray finger along x from the origin: a front at z = 0 and a back that meets it at the tip, joined by ribs.
    An object that presses the front bends the tip towards itself. The foot is held."""

    kind: Literal["fin-ray"]
    """A Fin Ray finger."""
    length: Length = Field(default=80.0, gt=0)
    """Length along x."""
    base: Length = Field(default=40.0, gt=0)
    """Height along z at the foot, both walls included."""
    tip: Length = Field(default=4.5, gt=0)
    """Height along z at the tip."""
    width: Length = Field(default=20.0, gt=0)
    """Width along y."""
    wall: Length = Field(default=1.5, gt=0)
    """Thickness of the front and of the back."""
    ribs: PositiveInt = 4
    """Number of ribs."""
    rib: Length = Field(default=1.5, gt=0)
    """Thickness of a rib."""
    rib_angle: Angle = Field(default=7 * pi / 36, gt=-pi / 3, lt=pi / 3)
    """Angle by which ribs lean towards the tip from the front to the back; 0 for ribs square to the front."""
    foot: Length = Field(default=4.0, gt=0)
    """Thickness of the foot along x."""

    def check(self) -> None:
        """Checks that walls, ribs and foot leave room between them."""
        slope = (self.base - self.tip) / self.length
        end = (self.base - self.wall * (2 + hypot(1, slope))) / slope if slope > 0 else 0.0
        end = min(end, self.length - 2 * self.wall)
        if self.tip <= 2 * self.wall or end <= self.foot:
            raise ValueError("tip must be above 2 wall, base above tip, and a room must be left between foot and tip")
        pitch = (end - self.foot) / (self.ribs + 1)
        height = self.base if self.rib_angle < 0 else self.tip + slope * pitch  # of the room that leaning ribs narrow
        if pitch - self.rib / cos(self.rib_angle) <= abs(tan(self.rib_angle)) * height:
            raise ValueError("the ribs fill the finger: take fewer or thinner ones, or a smaller rib_angle")


def fin_ray(spec: FinRay) -> Solid:
    """The solid along x from x = 0, symmetric about y = 0, with its front at z = 0."""
    outside = [(0.0, 0.0), (spec.length, 0.0), (spec.length, spec.tip), (0.0, spec.base)]
    return Difference(_across(outside, spec.width), tuple(_across(room, 1.1 * spec.width) for room in rooms(spec)))


def rooms(spec: FinRay) -> list[list[Corner]]:
    """Corners (x, z) of the rooms between the ribs, from the foot to the tip, each one's first two on the front."""
    lean, half, end = np.tan(spec.rib_angle), spec.rib / np.cos(spec.rib_angle) / 2, front_end(spec)
    middles = np.linspace(spec.foot, end, spec.ribs + 2)[1:-1].tolist()
    lows = [(spec.foot, 0.0), *((x + half, lean) for x in middles)]  # of each room: x on the front, and lean
    highs = [*((x - half, lean) for x in middles), (end, 0.0)]
    return [
        [(low[0], spec.wall), (high[0], spec.wall), _on_back(spec, *high), _on_back(spec, *low)]
        for low, high in zip(lows, highs, strict=True)
    ]


def front_end(spec: FinRay) -> float:
    """x mm where the last room ends: two walls before the tip, or where the walls are one thickness from each other."""
    return min((_inner(spec) - 2 * spec.wall) / _slope(spec), spec.length - 2 * spec.wall)


def tip(spec: FinRay) -> np.ndarray:
    """Point (3,) mm at the free end, in its middle."""
    return np.array([spec.length, 0.0, spec.tip / 2])


def _slope(spec: FinRay) -> float:
    """Slope of the back towards the front, mm a mm along x."""
    return (spec.base - spec.tip) / spec.length


def _inner(spec: FinRay) -> float:
    """z mm of the inside of the back at x = 0."""
    return float(spec.base - spec.wall * np.hypot(1.0, _slope(spec)))


def _on_back(spec: FinRay, x: float, lean: float) -> Corner:
    """Corner where the line from (x, wall) on the front, with this lean towards the tip, meets the back."""
    height = (_inner(spec) - spec.wall - _slope(spec) * x) / (1 + _slope(spec) * lean)
    return x + height * lean, spec.wall + height


def _across(corners: list[Corner], width: float) -> Solid:
    """The polygon through corners (x, z), this wide about y = 0."""
    sides = [tuple((x, y, z) for x, z in corners) for y in (-width / 2, width / 2)]
    return Loft(*sides)
