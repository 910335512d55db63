"""The error of a learned model's natural frequencies beside those of the finite elements that it learned from."""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from pydantic import Field, ValidationError

from cfem.condensed.model_error import ErrorBound
from cfem.core.errors import InputError, NumericalError
from cfem.core.reading import Data
from cfem.motion.model import MotionModel
from cfem.predict.series.state_error import extrapolation


class FrequencyError(Data):
    """Bounds of the relative error of each of the lowest natural frequencies, the lowest first.

    held, free: with the actuators held, and with their forces given
    probability: that a bound holds at a state like the test states; states: test states in the domain, where the robot
    is stable, which it was taken from; left_out: the others"""

    probability: float = Field(gt=0, lt=1)
    states: int = Field(ge=1)
    left_out: int = Field(ge=0)
    held: tuple[ErrorBound, ...] = Field(min_length=1)
    free: tuple[ErrorBound, ...] = Field(min_length=1)

    @property
    def words(self) -> str:
        """Sentence on the frequencies that the bounds are of, and how often they hold."""
        which = "the first frequency" if len(self.held) == 1 else f"each of the first {len(self.held)} frequencies"
        return f"error of {which} at most, in {100 * self.probability:.0f} % of the unseen states"


def frequency_error_of(motion: Mapping[str, Any] | None) -> FrequencyError | None:
    """Error of its frequencies that a model states among the facts of its motion, None where it says nothing.
    InputError where it is stated as by another version."""
    if not motion or not motion.get("frequency_error"):
        return None
    try:
        return FrequencyError.model_validate_json(json.dumps(motion["frequency_error"]))
    except ValidationError:
        raise InputError(
            "the model states the error of its frequencies as another version does", do="train it again"
        ) from None


def frequency_error(model: MotionModel, delta_a: np.ndarray, held: bool = True) -> np.ndarray | None:
    """Relative errors of the model's lowest natural frequencies at delta_a (n_a,) mm, at most, each with the stated
    probability; infinite outside its domain. None where the model states none."""
    stated = frequency_error_of(model.static.meta.get("motion"))
    if stated is None:
        return None
    bounds = stated.held if held else stated.free
    try:
        state = model.static.at_displacement(np.asarray(delta_a, float))
    except NumericalError:  # so far outside that the model does not answer
        return np.full(len(bounds), np.inf)
    if not model.static.inside(state):
        return np.full(len(bounds), np.inf)
    L = extrapolation(model.static, state)
    return np.array([float(bound.at(L)) for bound in bounds])
