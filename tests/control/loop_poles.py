"""Stability of the closed loop of cfem.plant.gains, from its polynomial."""

import numpy as np


def integral_bound(late: int) -> float:
    """m K_I below which the loop with K_P = 0 is stable."""
    return 2 * np.sin(np.pi / (2 * (2 * late + 1)))


def poles(proportional: float, integral: float, late: int, m: float = 1.0) -> np.ndarray:
    """(late + 2,) complex: of the closed loop; stable where all lie within the unit circle."""
    loop = np.zeros(late + 3)
    loop[:2] = 1.0, -1.0
    loop[-2:] += m * np.array([proportional + integral, -proportional])
    return np.roots(loop)
