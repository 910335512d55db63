"""What is asked of a finger beside the catalogue of objectives."""

import numpy as np

PULL = 8.0  # mm of each cable, as in design.yaml


def effort(W: np.ndarray, delta_free: np.ndarray, p: np.ndarray) -> np.ndarray:
    """(m,) N: sum of the tensions of both cables; W (m, 5, 5) and delta_free (m, 5) in the order tip x, y, z, left,
    right."""
    a = slice(3, 5)
    return np.linalg.solve(W[:, a, a], (PULL - delta_free[:, a])[..., None])[..., 0].sum(axis=1)
