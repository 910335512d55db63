"""Goals and samples that cannot be meant, since their unit is another one."""

import numpy as np

from cfem.condensed.rows import Rows
from cfem.core.errors import InputError

FAR = 2.0  # lengths of the robot from where the effectors rest: a length beyond its own box
AWAY = 0.5  # lengths of the robot from rest, from where on a place may be one in metres


def far_of(rows: Rows, length: float) -> np.ndarray:
    """Distances (n_e,) mm from rest that a goal may have in each effector row; inf for rotations."""
    return np.where(rows.turns, np.inf, FAR * length)


def demand_near(goal: np.ndarray, rest_e: np.ndarray, far: np.ndarray) -> None:
    """InputError where a goal cannot be meant; arguments as of `doubt`."""
    if strange := doubt(goal, rest_e, far):
        raise InputError(f"the goal {goal.tolist()} {strange}", do="give it in mm, in the frame of the scene")


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
    return "would be near the robot if it were in metres: goals are in mm" if in_metres(goal, rest_e, far) else ""


def in_metres(place: np.ndarray, rest_e: np.ndarray | float, far: np.ndarray | float) -> bool:
    """True if a place (n_e,) mm absolute, away from rest, would be near the robot if it were in metres; arguments as of
    `doubt`."""
    places = np.isfinite(np.broadcast_to(far, place.shape))
    length = np.broadcast_to(far, place.shape)[places] / FAR
    away, near = np.abs(place - rest_e)[places] > AWAY * length, np.abs(1e3 * place - rest_e)[places] <= length
    return bool(near.all() and away.any())
