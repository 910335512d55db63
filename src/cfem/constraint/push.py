"""A force in a fixed direction on a region of the body, such as a weight that hangs from it.

delta = direction . (y(x) - y_rest) in mm, the way that the region moves along the force; the multiplier is the force in
N. The row is linear."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from cfem.constraint.attachment import Attachment
from cfem.constraint.protocol import LinearConstraint


@dataclass(frozen=True)
class Push(LinearConstraint):
    """A force in a fixed direction on a region.

    nodes: (k,)
    weights: (k,) of sum 1
    direction: (3,) a unit vector
    rest: (1,) mm"""

    nodes: np.ndarray
    weights: np.ndarray
    direction: np.ndarray
    rest: np.ndarray
    units: ClassVar[tuple[str, str]] = ("mm", "N")

    def value(self, x: np.ndarray) -> np.ndarray:
        return np.array([self.weights @ x[self.nodes] @ self.direction])

    def gradient(self, x: np.ndarray) -> np.ndarray:
        return (self.weights[:, None] * self.direction)[None]


def make_push(points: Sequence[Attachment], direction: np.ndarray) -> Push:
    """The force is shared equally by the points."""
    nodes = np.unique(np.concatenate([point.nodes for point in points]))
    weights = np.zeros(len(nodes))
    for point in points:
        weights[np.searchsorted(nodes, point.nodes)] += point.weights / len(points)
    unit = np.asarray(direction, float) / np.linalg.norm(direction)
    rest = np.mean([point.point for point in points], axis=0) @ unit
    return Push(nodes, weights, unit, np.array([rest]))
