"""A bellows about the x axis: folds between two end plates, and one chamber."""

from itertools import pairwise
from math import hypot
from typing import Literal

import numpy as np
from pydantic import Field, PositiveInt

from cfem.core.spec import Spec
from cfem.core.units import Length
from cfem.robot.cad import Difference, Frustum, Solid, Union


class Bellows(Spec):
    """Folds in a row along x from the origin, round about this axis, between two end plates, with one chamber. Walls of
    the folds touch when it is sucked empty: `self_contact`."""

    kind: Literal["bellows"]
    """A bellows."""
    folds: PositiveInt = 4
    """Number of folds."""
    narrow: Length = Field(default=7.0, gt=0)
    """Radius of its outside in the troughs."""
    wide: Length = Field(default=13.0, gt=0)
    """Radius of its outside at the crests."""
    slope: Length = Field(default=2.0, gt=0)
    """Length along x from a trough to a crest."""
    crest: Length = Field(default=3.0, gt=0)
    """Length along x of the outside of a crest, and of a trough."""
    wall: Length = Field(default=1.5, gt=0)
    """Thickness of the walls of the folds."""
    plate: Length = Field(default=3.0, gt=0)
    """Thickness of each end plate."""

    def check(self) -> None:
        if not self.wall < self.narrow < self.wide - self.wall:
            raise ValueError("the wall must be thinner than narrow, and than wide less narrow")
        thinner = self.wall * (hypot(self.wide - self.narrow, self.slope) - self.slope) / (self.wide - self.narrow)
        if thinner >= self.crest / 2:
            raise ValueError(f"walls of the folds fill the crests: crest must be above {2 * thinner:.3g} mm")


def bellows(spec: Bellows) -> Solid:
    """The solid along x from x = 0; its chamber is left open inside it."""
    narrow, wide, half = spec.narrow, spec.wide, spec.crest / 2
    plates = [(0.0, narrow), (spec.plate, narrow)], [(length(spec) - spec.plate, narrow), (length(spec), narrow)]
    outer = _fold(narrow, wide, half, spec.slope, half)
    thinner = spec.wall * (np.hypot(wide - narrow, spec.slope) - spec.slope) / (wide - narrow)
    inner = _fold(narrow - spec.wall, wide - spec.wall, half + thinner, spec.slope, half - thinner)
    starts = [spec.plate + fold * pitch(spec) for fold in range(spec.folds)]
    outside = [*plates[0], *((x + start, r) for start in starts for x, r in outer), *plates[1]]
    return Difference(_revolved(outside), (_revolved([(x + start, r) for start in starts for x, r in inner]),))


def pitch(spec: Bellows) -> float:
    """Length mm of a fold along x."""
    return 2 * (spec.slope + spec.crest)


def length(spec: Bellows) -> float:
    """Length mm along x."""
    return 2 * spec.plate + spec.folds * pitch(spec)


def tip(spec: Bellows) -> np.ndarray:
    """Point (3,) mm at the free end, on the axis."""
    return np.array([length(spec), 0.0, 0.0])


def _fold(low: float, high: float, trough: float, slope: float, crest: float) -> list[tuple[float, float]]:
    """Corners (x, radius) of one fold from the middle of a trough to the next."""
    places = np.cumsum([0.0, trough, slope, 2 * crest, slope, trough])
    return list(zip(places.tolist(), [low, low, high, high, low, low], strict=True))


def _revolved(corners: list[tuple[float, float]]) -> Solid:
    """The solid within the line through corners (x, radius), turned about the x axis."""
    return Union(
        tuple(
            Frustum((x, 0.0, 0.0), (end - x, 0.0, 0.0), radius, end_radius)
            for (x, radius), (end, end_radius) in pairwise(corners)
            if end > x
        )
    )
