"""A plain bar along x: the smallest robot there is."""

from typing import Literal

import numpy as np
from pydantic import Field

from cfem.core.spec import Spec
from cfem.core.units import Length
from cfem.robot.cad import Box, Solid

ALONG = np.array([15.0, 35.0, 55.0]) / 60  # of the length: points of a cable
AWAY = 0.8  # of half the width or height: a cable's distance from the axis


class Bar(Spec):
    """A bar along x from the origin, centred on the x axis."""

    kind: Literal["bar"]
    """A straight bar."""
    length: Length = Field(default=60.0, gt=0)
    """Length along x."""
    width: Length = Field(default=10.0, gt=0)
    """Width along y."""
    height: Length = Field(default=10.0, gt=0)
    """Height along z."""


def bar(spec: Bar) -> Solid:
    y, z = spec.width / 2, spec.height / 2
    return Box((0.0, -y, -z), (spec.length, y, z))


def route(spec: Bar, side: np.ndarray) -> np.ndarray:
    """Points (3, 3) mm of a cable along the side in this direction (3,)."""
    return pull_point(spec, side) + np.outer(spec.length * ALONG, [1.0, 0.0, 0.0])


def pull_point(spec: Bar, side: np.ndarray) -> np.ndarray:
    """Point (3,) mm in the held end from which the cable along a side is pulled."""
    return AWAY * np.array([0.0, spec.width, spec.height]) / 2 * side


def tip(spec: Bar) -> np.ndarray:
    """Point (3,) mm just inside the free end."""
    return np.array([spec.length * 59 / 60, 0.0, 0.0])
