"""A cable through points of the body, perhaps to a fixed pull point: delta = l0 - l, its shortening in mm.

The multiplier is the tension in N, positive when the cable pulls. With d_s the vector along segment s, l_s = |d_s|:

    d delta = - sum_s (d_s / l_s) . dd_s,    d2 delta = - sum_s dd_s . (1 - t t^T) / l_s . dd_s,    t = d_s / l_s

Where friction takes tension away along the cable (equilibrium/friction), the multiplier is the tension at the first
segment, and delta = sum_s share_s (l0_s - l_s), the displacement that it does work on; all derivatives hold the
shares."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from cfem.constraint.attachment import Attachment
from cfem.core.errors import SpecError


@dataclass(frozen=True)
class Cable:
    """A cable of s segments d = along @ x[nodes] + start.

    nodes: (k,)
    along: (s, k)
    start: (s, 3) mm, minus the pull point for the first segment where there is one, else 0
    rest_lengths: (s,) mm
    cliques: one a segment
    rest: (1,) 0
    shares: (s,) tension in each segment, of that in the first
    friction: coefficient between cable and guides"""

    nodes: np.ndarray
    along: np.ndarray
    start: np.ndarray
    rest_lengths: np.ndarray
    cliques: tuple[np.ndarray, ...]
    rest: np.ndarray
    shares: np.ndarray
    friction: float = 0.0
    units: ClassVar[tuple[str, str]] = ("mm", "N")

    @property
    def rest_length(self) -> float:
        """Length mm at rest."""
        return float(self.rest_lengths.sum())

    def _segments(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        d = self.along @ x[self.nodes] + self.start
        return d, np.linalg.norm(d, axis=1)

    def value(self, x: np.ndarray) -> np.ndarray:
        return np.array([(self.shares * (self.rest_lengths - self._segments(x)[1])).sum()])

    def gradient(self, x: np.ndarray) -> np.ndarray:
        d, length = self._segments(x)
        return -(self.along.T @ (d * (self.shares / length)[:, None]))[None]

    def turned(self, x: np.ndarray) -> np.ndarray:
        """Angles (s,) rad by which the cable turns at the guide before each segment, 0 before the first."""
        d, length = self._segments(x)
        t = d / length[:, None]
        turned = np.arctan2(np.linalg.norm(np.cross(t[:-1], t[1:]), axis=1), (t[:-1] * t[1:]).sum(axis=1))
        return np.concatenate([[0.0], turned])

    @property
    def segments(self) -> tuple["Cable", ...]:
        """Segments, each as a cable without friction."""
        parts = (
            (self.along[i : i + 1], self.start[i : i + 1], self.rest_lengths[i : i + 1], (self.cliques[i],))
            for i in range(len(self.shares))
        )
        return tuple(Cable(self.nodes, *part, self.rest, np.ones(1)) for part in parts)

    def at_rest(self, x: np.ndarray) -> "Cable":
        """The cable whose rest is where the nodes are at x."""
        return replace(self, rest_lengths=self._segments(x)[1])

    def curvature(self, x: np.ndarray) -> Sequence[np.ndarray]:
        """Hessian of delta, a block for each segment: -(1 - t t^T) / l on its ends."""
        d, length = self._segments(x)
        t = d / length[:, None]
        across = -(np.eye(3) - t[:, :, None] * t[:, None, :]) * (self.shares / length)[:, None, None]
        coupled = (row[row != 0.0] for row in self.along)
        products = (
            np.outer(c, c)[:, None, :, None] * block[:, None, :] for c, block in zip(coupled, across, strict=True)
        )
        return [product.reshape(1, 3 * len(product), -1) for product in products]

    def curvature_form(self, x: np.ndarray, motions: np.ndarray) -> np.ndarray:
        """Second derivative (k, k) M^T d2 delta M of the length along motions M (n, 3, k) of the nodes, without the
        blocks of `curvature`."""
        d, length = self._segments(x)
        t = d / length[:, None]
        moved = np.tensordot(self.along, motions[self.nodes], axes=1)  # (s, 3, k)
        across = moved - t[:, :, None] * np.einsum("si,sik->sk", t, moved)[:, None]
        return -np.einsum("s,sik,sil->kl", self.shares / length, across, moved)


def make_cable(points: Sequence[Attachment], pull_point: np.ndarray | None, name: str, friction: float = 0.0) -> Cable:
    """A cable through at least two points, the fixed pull point (3,) mm counted first where it is given. Free of the
    loss that its coefficient of friction makes.

    Raises SpecError where there are too few points or two neighbours coincide."""
    nodes = np.unique(np.concatenate([point.nodes for point in points])) if points else np.empty(0, dtype=int)
    positions = np.zeros((len(points), len(nodes)))
    for row, point in enumerate(points):
        positions[row, np.searchsorted(nodes, point.nodes)] = point.weights
    along, start = np.diff(positions, axis=0), np.zeros((max(len(points) - 1, 0), 3))
    if pull_point is not None:
        along, start = np.vstack([positions[:1], along]), np.vstack([-np.asarray(pull_point, float), start])
    if len(along) < 1:
        raise SpecError(f"cable '{name}' needs two points, or one and a pull point")
    ends = ([] if pull_point is None else [np.asarray(pull_point, float)]) + [point.point for point in points]
    lengths = np.linalg.norm(np.diff(ends, axis=0), axis=1)
    if lengths.min() < 1e-6 * max(lengths.max(), 1e-300):
        names = ([] if pull_point is None else ["its pull point"]) + [f"point {index}" for index in range(len(points))]
        first = int(lengths.argmin())
        raise SpecError(f"cable '{name}': {names[first]} and {names[first + 1]} coincide", do="leave one of them out")
    cliques = tuple(nodes[row != 0.0][None] for row in along)
    return Cable(nodes, along, start, lengths, cliques, np.zeros(1), np.ones(len(lengths)), friction)
