"""A cable in a straight channel of a rod: delta = l0 - l in mm; the multiplier is its tension in N.

The channel keeps its place (y, z) = r(s) in the sections, linear in s between its points. On an element of constant
strain e (mechanics/rod/element.py) the cable's tangent is t = (1, r') + gamma + kappa x r with gamma, kappa = e / h. It
is affine in e, so that

    l = sum over elements, int |t| ds        dl/de = int B^T t / |t| ds        d2l/de2 = int B^T (1 - t t^T) B / |t| ds

(the unit t in the last, B = dt/de). No sections but the rod's own are needed, however much it bends between them, while
a polygon through points of the sections cuts the bend short by kappa h^2 / 12, as much as a thin rod's cable is off its
axis."""

from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar

import numpy as np

from cfem.constraint.rod_row import RodRow, Strained
from cfem.core.errors import SpecError
from cfem.mechanics.rod.region import Rod, response

_POINTS = np.array([-1, 1]) / np.sqrt(3)  # of Gauss's rule on each piece


@dataclass(frozen=True)
class RodCable(RodRow):
    """A cable in a channel of a rod, at q points along it.

    element: (q,) that each lies in
    weight: (q,) mm
    along, B: (q, 3) = (1, r') and (q, 3, 6) 1/mm, t = along + B e
    shares: (q,) tension there, of that at the start
    friction: coefficient in the channel"""

    element: np.ndarray
    weight: np.ndarray
    along: np.ndarray
    B: np.ndarray
    shares: np.ndarray
    friction: float = 0.0
    units: ClassVar[tuple[str, str]] = ("mm", "N")

    @property
    def rest_length(self) -> float:
        """Length mm at rest."""
        return float(self.weight @ np.linalg.norm(self.along, axis=1))

    def strained(self, e: np.ndarray) -> Strained:
        """Value and derivatives by the strains e (m, 6) of the rod."""
        t, length, B, weight = *self._tangent(e), self.B, self.weight * self.shares
        unit = t / length[:, None]
        value = float(weight @ (np.linalg.norm(self.along, axis=1) - length))
        by_e, second = np.zeros_like(e), np.zeros((len(e), 6, 6))
        np.add.at(by_e, self.element, -weight[:, None] * (unit[:, None] @ B)[:, 0])
        across = np.eye(3) - unit[:, :, None] * unit[:, None]
        np.add.at(second, self.element, -(weight / length)[:, None, None] * (B.swapaxes(1, 2) @ across @ B))
        return Strained(value, by_e, second)

    def turned(self, x: np.ndarray) -> np.ndarray:
        """Angles (q,) rad by which the cable turns before each point and after the one before, at positions x (n, 3)
        mm."""
        e = response(self.rod, x).strain.e
        t, length = self._tangent(e)
        bend = e[self.element, 3:] / self.rod.length[self.element, None]
        around = np.linalg.norm(np.cross(bend, t / length[:, None]), axis=1) * self.weight / 2
        return around + np.concatenate([[0.0], around[:-1]])

    @property
    def segments(self) -> tuple["RodCable", ...]:
        """The cable around each of its points as a cable of its own, without friction."""
        points = (slice(i, i + 1) for i in range(len(self.weight)))
        return tuple(
            RodCable(self.rod, self.element[i], self.weight[i], self.along[i], self.B[i], np.ones(1)) for i in points
        )

    def _tangent(self, e: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        t = self.along + (self.B @ e[self.element][:, :, None])[:, :, 0]
        return t, np.linalg.norm(t, axis=1)


def make_rod_cable(rod: Rod, points: np.ndarray, name: str, friction: float = 0.0) -> RodCable:
    """Cable through points (k, 3) mm at rest, in ascending x between the first section and the last. SpecError where
    they are not."""
    stations = rod.sections.centres[:, 0]
    near = 1e-9 * np.ptp(stations)
    if not (np.diff(points[:, 0]) > near).all():
        what = f"cable '{name}': on a rod it runs from the base to the tip, so its points must ascend in x"
        raise SpecError(what, where="points", do="put them in order, and leave out those that coincide")
    if points[0, 0] < stations[0] - near or points[-1, 0] > stations[-1] + near:
        what = f"cable '{name}' lies outside the sections, x from {stations[0]:g} to {stations[-1]:g} mm"
        raise SpecError(what, where="points", do="move its points between the base and the tip")
    stops = np.unique(np.concatenate([stations, points[:, 0]]))
    stops = stops[(stops >= points[0, 0] - near) & (stops <= points[-1, 0] + near)]
    ends = np.array([pair for pair in pairwise(stops) if pair[1] - pair[0] > near])
    half = np.diff(ends, axis=1)[:, 0] / 2
    places = (ends.mean(axis=1)[:, None] + half[:, None] * _POINTS).ravel()
    element = np.clip(np.searchsorted(stations, places) - 1, 0, len(stations) - 2)
    piece = np.clip(np.searchsorted(points[:, 0], places) - 1, 0, len(points) - 2)
    slope = (np.diff(points, axis=0) / np.diff(points[:, 0])[:, None])[piece, 1:]
    centres = rod.sections.centres[:, 1:]
    y, z = (points[piece, 1:] - centres[element] + slope * (places - points[piece, 0])[:, None]).T
    B = np.zeros((len(places), 3, 6))
    B[:, [0, 1, 2], [0, 1, 2]] = 1.0
    # kappa x (0, y, z)
    B[:, 0, 4], B[:, 0, 5], B[:, 1, 3], B[:, 2, 3] = z, -y, -z, y
    B /= rod.length[element][:, None, None]
    along = np.column_stack([np.ones(len(places)), slope])
    return RodCable(rod, element, np.repeat(half, 2), along, B, np.ones(len(places)), friction)
