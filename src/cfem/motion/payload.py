"""A mass that the robot carries at an effector's point."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Payload:
    """A mass that the robot carries."""

    mass: float  # t
    rows: tuple[int, int, int] = (0, 1, 2)  # the three of its point among the effectors'
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0)  # (3,) mm/s^2 that pulls at it

    def rows_of(self, effectors: np.ndarray) -> np.ndarray:
        """Rows (3, ...) of the payload's point, from the effectors' (n_e, ...)."""
        return effectors[list(self.rows)]

    @property
    def weight(self) -> np.ndarray:
        """Weight (3,) N."""
        return self.mass * np.asarray(self.gravity)
