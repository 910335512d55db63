"""Rows that act on the strains of a rod, not on nodes."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from cfem.constraint.protocol import LinearConstraint
from cfem.mechanics.rod.region import Rod, response


@dataclass(frozen=True)
class Strained:
    """Value and derivatives of a row at strains e (m, 6).

    value: of the row
    by_e: (m, 6) its derivative
    second: (m, 6, 6), None where the row is linear"""

    value: float
    by_e: np.ndarray
    second: np.ndarray | None = None


@dataclass(frozen=True)
class RodRow(LinearConstraint, ABC):
    """A row of a rod: of its m elements' strains e (m, 6), and of no node."""

    rod: Rod
    nodes: ClassVar[np.ndarray] = np.empty(0, dtype=int)
    rest: ClassVar[np.ndarray] = np.zeros(1)

    @abstractmethod
    def strained(self, e: np.ndarray) -> Strained:
        """Value and derivatives by the strains e (m, 6)."""

    def value(self, x: np.ndarray) -> np.ndarray:
        """Value (1,) at positions x (n, 3) mm."""
        return np.array([self.strained(response(self.rod, x).strain.e).value])

    def gradient(self, x: np.ndarray) -> np.ndarray:
        """Gradient (1, 0, 3) by nodes: none moves it, strains do."""
        return np.zeros((1, 0, 3))
