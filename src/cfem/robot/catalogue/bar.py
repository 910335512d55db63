"""A plain bar along x: the smallest robot there is."""

import numpy as np

from cfem.robot import geometry
from cfem.robot.cad import Box, Solid

ALONG = np.array([15.0, 35.0, 55.0]) / 60  # of the length: points of a cable
AWAY = 0.8  # of half the width or height: a cable's distance from the axis


def bar(spec: geometry.Bar) -> Solid:
    y, z = spec.width / 2, spec.height / 2
    return Box((0.0, -y, -z), (spec.length, y, z))


def route(spec: geometry.Bar, side: np.ndarray) -> np.ndarray:
    """Points (3, 3) mm of a cable along the side in this direction (3,)."""
    return pull_point(spec, side) + np.outer(spec.length * ALONG, [1.0, 0.0, 0.0])


def pull_point(spec: geometry.Bar, side: np.ndarray) -> np.ndarray:
    """Point (3,) mm in the held end from which the cable along a side is pulled."""
    return AWAY * np.array([0.0, spec.width, spec.height]) / 2 * side


def tip(spec: geometry.Bar) -> np.ndarray:
    """Point (3,) mm just inside the free end."""
    return np.array([spec.length * 59 / 60, 0.0, 0.0])
