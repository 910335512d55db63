"""Shares of what an actuator can do: cables in mm and chambers in mm^3 are told apart by their own strokes alone."""

import numpy as np

STEP = 0.25  # the largest move of an actuator in one inverse step, unless stated
TOLERANCE = 5e-7  # the move of every actuator below which inverse steps end, unless stated
FE_TOLERANCE = 5e-5  # the same on FE matrices, where less is not worth a solve


def stroke(reach: np.ndarray) -> np.ndarray:
    """Full strokes (n_a,) of the actuators in their units, from their reach (n_a, 2)."""
    return np.abs(reach).max(axis=1)


def stated_or_share(stated: float | None, share: float, reach: np.ndarray) -> np.ndarray:
    """Values (n_a,) of a quantity for all actuators: the stated one, or `share` of the stroke of each (reach (n_a, 2))
    where none is stated."""
    full = stroke(reach)
    return share * full if stated is None else np.full(len(full), float(stated))


def ridge_of(regularisation: float, reach: np.ndarray, length: float) -> np.ndarray:
    """Weights (n_a,) such that a full stroke (reach (n_a, 2) mm or mm^3) costs `regularisation` times what missing by
    `length` mm costs."""
    return np.sqrt(regularisation) * length / stroke(reach)
