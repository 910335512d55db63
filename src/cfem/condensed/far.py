"""Goals that cannot be meant, since their unit is another one."""

import numpy as np

from cfem.condensed.rows import Rows

FAR = 2.0  # lengths of the robot from where the effectors rest: a length beyond its own box
AWAY = 0.5  # lengths of the robot from rest, from where on a goal may be one in metres


def far_of(rows: Rows, length: float) -> np.ndarray:
    """Distances (n_e,) mm from rest that a goal may have in each effector row; inf for rotations."""
    return np.where(rows.turns, np.inf, FAR * length)


def doubt(goal: np.ndarray, rest_e: np.ndarray, far: np.ndarray) -> str:
    """Sentence on why a goal (n_e,) mm absolute cannot be meant, '' where it can; rest_e (n_e,) mm; far (n_e,) mm of
    `far_of`."""
    places = np.isfinite(far)
    away, length = np.abs(goal - rest_e)[places], far[places] / FAR
    if not places.any():
        return ""
    if (away > far[places]).any():
        worst = int((away / length).argmax())
        apart, times = away[worst], away[worst] / length[worst]
        return f"is {apart:.3g} mm from where the effector rests, {times:.3g} times the robot's length: goals are in mm"
    near = np.abs(1e3 * goal - rest_e)[places] <= length
    if near.all() and (away > AWAY * length).any():
        return "would be near the robot if it were in metres: goals are in mm"
    return ""
