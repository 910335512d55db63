"""A tube about the x axis, closed by plates: the body of a McKibben muscle under its braid."""

import numpy as np

from cfem.robot import geometry
from cfem.robot.cad import Difference, Frustum, Solid


def tube(spec: geometry.Tube) -> Solid:
    """The solid along x from x = 0; its chamber is left open inside it."""
    outer = Frustum((0.0, 0.0, 0.0), (spec.length, 0.0, 0.0), spec.radius, spec.radius)
    bore, room = spec.radius - spec.wall, spec.length - 2 * spec.plate
    return Difference(outer, (Frustum((spec.plate, 0.0, 0.0), (room, 0.0, 0.0), bore, bore),))


def tip(spec: geometry.Tube) -> np.ndarray:
    """Point (3,) mm at the free end, on the axis."""
    return np.array([spec.length, 0.0, 0.0])
