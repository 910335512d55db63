"""A bellows about the x axis: folds between two end plates, and one chamber."""

from itertools import pairwise

import numpy as np

from cfem.robot import geometry
from cfem.robot.cad import Difference, Frustum, Solid, Union


def bellows(spec: geometry.Bellows) -> Solid:
    """The solid along x from x = 0; its chamber is left open inside it."""
    narrow, wide, half = spec.narrow, spec.wide, spec.crest / 2
    plates = [(0.0, narrow), (spec.plate, narrow)], [(length(spec) - spec.plate, narrow), (length(spec), narrow)]
    outer = _fold(narrow, wide, half, spec.slope, half)
    thinner = spec.wall * (np.hypot(wide - narrow, spec.slope) - spec.slope) / (wide - narrow)
    inner = _fold(narrow - spec.wall, wide - spec.wall, half + thinner, spec.slope, half - thinner)
    starts = [spec.plate + fold * pitch(spec) for fold in range(spec.folds)]
    outside = [*plates[0], *((x + start, r) for start in starts for x, r in outer), *plates[1]]
    return Difference(_revolved(outside), (_revolved([(x + start, r) for start in starts for x, r in inner]),))


def pitch(spec: geometry.Bellows) -> float:
    """Length mm of a fold along x."""
    return 2 * (spec.slope + spec.crest)


def length(spec: geometry.Bellows) -> float:
    """Length mm along x."""
    return 2 * spec.plate + spec.folds * pitch(spec)


def tip(spec: geometry.Bellows) -> np.ndarray:
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
