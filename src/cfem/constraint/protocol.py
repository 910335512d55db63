"""What mechanics needs to know of whatever touches a body."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np


class Watched(Protocol):
    """Rows of delta that are only looked at (effectors): value and gradient."""

    nodes: np.ndarray  # (k,) indices of the nodes that it depends on
    rest: np.ndarray  # (rows,) value at rest

    def value(self, x: np.ndarray) -> np.ndarray:
        """(rows,) at positions x (n, 3) mm."""

    def gradient(self, x: np.ndarray) -> np.ndarray:
        """(rows, k, 3) derivative by the positions of `nodes`."""


class Constraint(Watched, Protocol):
    """One row of delta that carries a multiplier (cable, chamber): also its curvature, which is part of the tangent."""

    cliques: Sequence[np.ndarray]  # groups of nodes (k_g,) that the curvature couples

    def curvature(self, x: np.ndarray) -> Sequence[np.ndarray]:
        """One symmetric (3 k_g, 3 k_g) matrix a clique; their sum is the second derivative of the value."""
