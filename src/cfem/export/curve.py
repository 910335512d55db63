"""A closed curve that a robot's tips can follow, for examples."""

import numpy as np

from cfem.condensed.model import under_force
from cfem.motion.model import MotionModel

POINTS = 192
MIDDLE, SWING = 0.4, 0.14  # of the largest forces


def curve_of(model: MotionModel) -> tuple[np.ndarray, np.ndarray]:
    """Displacements of the actuators at the start (n_a,) mm, and places (POINTS, n_e) mm where the tips rest while
    forces go round a figure-eight about their middle."""
    static, n_a = model.static, model.n_a
    largest = np.abs(static.domain.lambda_a).max(axis=0)
    turn = np.pi * (2 * np.arange(n_a) + 1) / (2 * n_a)
    phase = 2 * np.pi * np.arange(POINTS + 1)[:, None] / POINTS
    shares = MIDDLE + SWING * (np.cos(turn) * np.sin(phase) + np.sin(turn) * np.sin(2 * phase))
    near, places, start = static.at_displacement(static.domain.nearest(MIDDLE * largest, "force")), [], None
    for share in shares:
        near = under_force(static, share * largest, near)
        start = near.delta_a if start is None else start
        places.append(model.rest_e + near.delta_e)
    return start, np.array(places[:-1])
