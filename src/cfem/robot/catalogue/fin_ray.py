"""A Fin Ray finger after Kniese and Festo: two walls that meet at the tip, joined by ribs."""

import numpy as np

from cfem.robot import geometry
from cfem.robot.cad import Difference, Loft, Solid

Corner = tuple[float, float]


def fin_ray(spec: geometry.FinRay) -> Solid:
    """The solid along x from x = 0, symmetric about y = 0, with its front at z = 0."""
    outside = [(0.0, 0.0), (spec.length, 0.0), (spec.length, spec.tip), (0.0, spec.base)]
    return Difference(_across(outside, spec.width), tuple(_across(room, 1.1 * spec.width) for room in rooms(spec)))


def rooms(spec: geometry.FinRay) -> list[list[Corner]]:
    """Corners (x, z) of the rooms between the ribs, from the foot to the tip, each one's first two on the front."""
    lean, half, end = np.tan(spec.rib_angle), spec.rib / np.cos(spec.rib_angle) / 2, front_end(spec)
    middles = np.linspace(spec.foot, end, spec.ribs + 2)[1:-1].tolist()
    lows = [(spec.foot, 0.0), *((x + half, lean) for x in middles)]  # of each room: x on the front, and lean
    highs = [*((x - half, lean) for x in middles), (end, 0.0)]
    return [
        [(low[0], spec.wall), (high[0], spec.wall), _on_back(spec, *high), _on_back(spec, *low)]
        for low, high in zip(lows, highs, strict=True)
    ]


def front_end(spec: geometry.FinRay) -> float:
    """x mm where the last room ends: two walls before the tip, or where the walls are one thickness from each other."""
    return min((_inner(spec) - 2 * spec.wall) / _slope(spec), spec.length - 2 * spec.wall)


def tip(spec: geometry.FinRay) -> np.ndarray:
    """Point (3,) mm at the free end, in its middle."""
    return np.array([spec.length, 0.0, spec.tip / 2])


def _slope(spec: geometry.FinRay) -> float:
    """Slope of the back towards the front, mm a mm along x."""
    return (spec.base - spec.tip) / spec.length


def _inner(spec: geometry.FinRay) -> float:
    """z mm of the inside of the back at x = 0."""
    return float(spec.base - spec.wall * np.hypot(1.0, _slope(spec)))


def _on_back(spec: geometry.FinRay, x: float, lean: float) -> Corner:
    """Corner where the line from (x, wall) on the front, with this lean towards the tip, meets the back."""
    height = (_inner(spec) - spec.wall - _slope(spec) * x) / (1 + _slope(spec) * lean)
    return x + height * lean, spec.wall + height


def _across(corners: list[Corner], width: float) -> Solid:
    """The polygon through corners (x, z), this wide about y = 0."""
    sides = [tuple((x, y, z) for x, z in corners) for y in (-width / 2, width / 2)]
    return Loft(*sides)
