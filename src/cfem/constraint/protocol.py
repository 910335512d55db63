"""Protocol of a constraint: what mechanics asks of whatever touches a body."""

from collections.abc import Sequence
from typing import ClassVar, Protocol

import numpy as np


class Watched(Protocol):
    """Rows of delta that are only looked at (effectors): value and gradient."""

    nodes: np.ndarray  # (k,) indices of the nodes that it depends on
    rest: np.ndarray  # (rows,) value at rest

    def value(self, x: np.ndarray) -> np.ndarray:
        """Values (rows,) at positions x (n, 3) mm."""

    def gradient(self, x: np.ndarray) -> np.ndarray:
        """Gradient (rows, k, 3) by the positions of `nodes`."""


class Constraint(Watched, Protocol):
    """Rows of delta that carry a multiplier: one of a cable or a cavity, three of a contact point. An actuator also has
    `units`: of its displacement and of its multiplier.

    The curvature is part of the tangent; only a single row has one. It comes in batches of small symmetric matrices."""

    cliques: tuple[np.ndarray, ...]  # a batch: (g, k) indices, g groups of k nodes that the curvature couples

    def curvature(self, x: np.ndarray) -> Sequence[np.ndarray]:
        """Batches (g, 3 k, 3 k), whose sum, node by node, is the second derivative of the value."""


class LinearConstraint:
    """A constraint whose value is linear in the nodes."""

    cliques: ClassVar[tuple[np.ndarray, ...]] = ()

    def curvature(self, x: np.ndarray) -> Sequence[np.ndarray]:
        """No batches: the second derivative is zero."""
        return ()
