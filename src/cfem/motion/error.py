"""The error of a learned model's natural frequencies beside those of the finite elements that it learned from."""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from pydantic import Field

from cfem.condensed.model_error import ErrorBound
from cfem.core.errors import NumericalError
from cfem.core.reading import Data
from cfem.motion.model import MotionModel
from cfem.predict.series.state_error import extrapolation


class FrequencyError(Data):
    """Bounds of the largest relative error among the lowest natural frequencies.

    modes: how many frequencies; held, free: with the actuators held, and with their forces given
    probability: that the bound holds at a state like the test states; states: test states in the domain, where the
    robot is stable, which it was taken from; left_out: the others"""

    modes: int = Field(ge=1)
    probability: float = Field(gt=0, lt=1)
    states: int = Field(ge=1)
    left_out: int = Field(ge=0)
    held: ErrorBound
    free: ErrorBound

    @property
    def words(self) -> str:
        """Sentence on the frequencies that the bounds are of, and how often they hold."""
        which = "the first frequency" if self.modes == 1 else f"the first {self.modes} frequencies"
        return f"error of {which} at most, in {100 * self.probability:.0f} % of the unseen states"


def frequency_error_of(motion: Mapping[str, Any] | None) -> FrequencyError | None:
    """Error of its frequencies that a model states among the facts of its motion, None where it says nothing."""
    if not motion or not motion.get("frequency_error"):
        return None
    return FrequencyError.model_validate_json(json.dumps(motion["frequency_error"]))


def frequency_error(model: MotionModel, delta_a: np.ndarray, held: bool = True) -> float | None:
    """Relative error of the model's lowest natural frequencies at delta_a (n_a,) mm, at most, with the stated
    probability; infinite outside its domain. None where the model states none."""
    stated = frequency_error_of(model.static.meta.get("motion"))
    if stated is None:
        return None
    try:
        state = model.static.at_displacement(np.asarray(delta_a, float))
    except NumericalError:  # so far outside that the model does not answer
        return float("inf")
    if not model.static.inside(state):
        return float("inf")
    bound = stated.held if held else stated.free
    return float(bound.at(extrapolation(model.static, state)))
