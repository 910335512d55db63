"""Natural frequencies and damping of a learned model along its workspace."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from cfem.core.errors import NumericalError
from cfem.motion.error import frequency_error
from cfem.motion.model import MotionModel
from cfem.motion.modes import natural_modes

PLACES = 5  # on the way from rest to the ends


def outwards(model: MotionModel) -> list[np.ndarray]:
    """States (n_a,) mm of the training set, from the nearest to rest to the farthest of all."""
    states = model.static.domain.states[:, : model.n_a]
    far = np.linalg.norm(states / np.abs(model.static.reach).max(axis=1), axis=1)
    order = np.argsort(far)
    return [states[order[place]] for place in np.linspace(0, len(order) - 1, PLACES).round().astype(int)]


def vibrations(model: MotionModel, states: Iterable[np.ndarray], free: bool, count: int = 3) -> list[dict[str, Any]]:
    """Vibrations of each state: rows of delta_a, and of the lowest modes frequency in Hz and damping as a share of the
    critical; none of them, and `why`, where the robot is unstable. free: whether the actuators are, instead of held.
    `frequency_error`, where the model states one: relative, of each of its first frequencies at most; None outside."""
    rows = []
    for delta in states:
        try:
            modes = natural_modes(model, delta, not free, count)
            row = {"frequency": modes.frequency.tolist(), "damping": modes.damping.tolist()}
            stated = frequency_error(model, delta, not free)
            row |= {} if stated is None else {"frequency_error": stated.tolist() if np.isfinite(stated).all() else None}
        except NumericalError as error:
            row = {"frequency": [], "damping": [], "why": error.what}
        rows.append({"delta_a": delta.tolist(), **row})
    return rows
