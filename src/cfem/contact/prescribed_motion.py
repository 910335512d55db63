"""Obstacles that move while a robot goes through its goals: where each is at a share of the run, and how it carries
what sticks to it.

Nothing moves by itself: robots are quasi-static, so that only the way counts, and friction counts it in steps."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from typing import Any, Protocol

import numpy as np

from cfem.contact.obstacle import Obstacle

Stop = tuple[float, float]  # shares of the run from which and to which a step goes


class PrescribedMotion(Protocol):
    """Motion of an obstacle over a run: share 0 is the first goal, 1 the last."""

    def at(self, share: float) -> Obstacle: ...

    def way(self, begin: float, end: float) -> float:
        """Largest way, mm: no point of it moves more."""
        ...

    def carried(self, points: np.ndarray, begin: float, end: float) -> np.ndarray:
        """Places (k, 3) mm at `end` of points of its surface that are at (k, 3) mm at `begin`."""
        ...


@dataclass(frozen=True)
class Translation:
    """A rigid body that moves without turning.

    places: (k, 3) mm, its displacements, evenly spread over the run, straight from one to the next; a single one stands
    still"""

    obstacle: Obstacle
    places: np.ndarray

    def at(self, share: float) -> Obstacle:
        return replace(self.obstacle, t=self.obstacle.t + between(self.places, share))

    def way(self, begin: float, end: float) -> float:
        stops = [begin, *corners(len(self.places), begin, end), end]
        displacements = np.array([between(self.places, share) for share in stops])
        return float(np.linalg.norm(np.diff(displacements, axis=0), axis=1).sum())

    def carried(self, points: np.ndarray, begin: float, end: float) -> np.ndarray:
        return points + between(self.places, end) - between(self.places, begin)


class ActuatedRobot:
    """A learned robot with a skin as an obstacle that does not yield. Its actuators go through deltas (k, n_a) mm as
    `Translation` does through places; R (3, 3) and t (3,) mm place it. make: an obstacle of its surface (m, 3) mm; it
    has `surface`, which knows the nearest triangles."""

    def __init__(self, model: Any, deltas: np.ndarray, make: Any, R: np.ndarray, t: np.ndarray):
        self.model, self._deltas, self._make, self.R, self.t = model, deltas, make, R, t
        self.at = lru_cache(maxsize=4)(self._at)

    def _at(self, share: float) -> Obstacle:
        return self._make(self._shape(share))

    def deltas(self, share: float) -> np.ndarray:
        """Displacements (n_a,) mm of its actuators."""
        return between(self._deltas, share)

    def _shape(self, share: float) -> np.ndarray:
        return self.model.shape(self.deltas(share)) @ self.R.T + self.t

    def way(self, begin: float, end: float) -> float:
        stops = [begin, *corners(len(self._deltas), begin, end), end]
        surfaces = np.array([self._shape(share) for share in stops])
        return float(np.linalg.norm(np.diff(surfaces, axis=0), axis=2).sum(axis=0).max())

    def carried(self, points: np.ndarray, begin: float, end: float) -> np.ndarray:
        corner, shares = self.at(begin).surface.on(points)
        before, after = (np.einsum("kc,kci->ki", shares, self._shape(share)[corner]) for share in (begin, end))
        return points + after - before


def between(values: np.ndarray, share: float) -> np.ndarray:
    """Value (...) at a share of the run, linear between values (k, ...)."""
    position = np.clip(share, 0.0, 1.0) * (len(values) - 1)
    first = min(int(position), max(len(values) - 2, 0))
    last = min(first + 1, len(values) - 1)
    return values[first] + (position - first) * (values[last] - values[first])


def corners(count: int, begin: float, end: float) -> list[float]:
    """Shares between two, at which the course of `count` places has a corner, in the order in which they come."""
    if count < 2:
        return []
    low, high = sorted((begin, end))
    shares = [i / (count - 1) for i in range(count) if low < i / (count - 1) < high]
    return shares if begin <= end else shares[::-1]


def stops(courses: Iterable[PrescribedMotion], begin: float, end: float, longest: float) -> Sequence[Stop]:
    """Steps from one share to another in which nothing moves more than `longest` mm."""
    length = max((course.way(begin, end) for course in courses), default=0.0)
    if length == 0.0:
        return []
    shares = np.linspace(begin, end, int(np.ceil(length / longest)) + 1).tolist()
    return list(pairwise(shares))
