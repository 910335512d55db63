"""A mass that the robot carries at an effector's point."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Payload:
    """mass: t; rows: the three of its point among the effectors'; gravity: (3,) mm/s^2 that pulls at it."""

    mass: float
    rows: tuple[int, int, int] = (0, 1, 2)
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def rows_of(self, effectors: np.ndarray) -> np.ndarray:
        """(3, ...) of the effectors' (n_e, ...)."""
        return effectors[list(self.rows)]

    @property
    def weight(self) -> np.ndarray:
        """(3,) N."""
        return self.mass * np.asarray(self.gravity)
