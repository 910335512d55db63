"""The error of a learned model beside the finite elements that it learned from, at any of its states."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Protocol, runtime_checkable

import numpy as np
from pydantic import Field

from cfem.condensed.condensed import Condensed
from cfem.condensed.model import Form
from cfem.core.reading import Data

_Size = Annotated[float, Field(ge=0)]


class ErrorBound(Data):
    """Bound that the error of one quantity keeps with the stated probability.

    everywhere: of any state in the domain; factor, power: factor L^power of a state where the model extrapolates by L
    (`cfem.predict.series.christoffel`), much less for most states"""

    everywhere: _Size
    factor: _Size
    power: Annotated[float, Field(ge=0, le=100)]

    def at(self, extrapolation: np.ndarray) -> np.ndarray:
        """Bounds (...,) where the model extrapolates by `extrapolation` (...,)."""
        return self.factor * extrapolation**self.power


class _Calibrated(Data):
    """Bounds that hold with a probability, calibrated on finite elements; left_out: of their states, those that the
    bounds are not of."""

    probability: float = Field(gt=0, lt=1)
    left_out: int = Field(ge=0)

    @property
    def percent(self) -> str:
        """The probability in words: '95 %'."""
        return f"{100 * self.probability:.0f} %"


class ModelError(_Calibrated):
    """Bounds of the distance between a model's answer and the finite elements' to the same command, on one mesh.

    tip: of all effector points together, mm, orientations left out; actuators: of what is not commanded, forces where
    displacements are, and displacements where forces are, each relative to its actuator's largest in the domain; W: of
    each entry W_ij, relative to the root of W_ii W_jj
    probability: of a state like the test states that the bound holds; states: test states in the domain, which it was
    taken from; left_out: the others"""

    states: int = Field(ge=1)
    command: Form
    tip: ErrorBound
    actuators: ErrorBound
    W: ErrorBound


class ContactFactors(Data):
    """Factors of `cfem.predict.contact.error.expected_error` that give bounds of the error of contact.

    force: of the force by any of the obstacles; tip: of how forces move all effector points together
    probability: that a bound holds at a place like those of the calibration; places: of it"""

    probability: float = Field(gt=0, lt=1)
    places: int = Field(ge=1)
    force: _Size
    tip: _Size


class ContactError(_Calibrated):
    """Bounds of the error of the contact of one robot, in trusted states, from rigid obstacles.

    one, several: where one obstacle touches, and where several do; None where no place tells it
    probability: the smaller of both; left_out: places that were not trusted, or where no state was found; friction:
    coefficient at all of them; most: obstacles that touched at once; points: that they pressed at once, at most
    off: (N,) mm, root mean squares of how far each point of the surface is off along its normal where nothing
    touches"""

    one: ContactFactors | None
    several: ContactFactors | None
    friction: float = Field(ge=0)
    most: int = Field(ge=1)
    points: int = Field(ge=1)
    off: list[float]

    def of(self, count: int) -> ContactFactors | None:
        """Factors where so many obstacles touch, None where nothing is stated."""
        return None if not 0 < count <= self.most else self.one if count == 1 else self.several


def model_error_of(stated: Mapping[str, Any] | None) -> ModelError | None:
    """Error that a model states, None where it says nothing."""
    if not stated:
        return None
    return ModelError.model_validate_json(json.dumps(dict(stated)))


@dataclass(frozen=True)
class StateError:
    """Bounds of a model's error at one state or several, infinite outside its domain: nothing is promised there.

    probability: of each bound; None under loads that the samples did not carry, whose part is an estimate
    tip: (...,) mm
    actuators: (..., n_a) of what is not commanded, in its unit; W: (..., n, n); both NaN under loads that the samples
    did not carry"""

    probability: float | None
    tip: np.ndarray
    actuators: np.ndarray
    W: np.ndarray

    @property
    def inside(self) -> np.ndarray:
        """Mask (...,) of the states that lie in the model's domain."""
        return np.isfinite(self.tip)


@runtime_checkable
class KnowsError(Protocol):
    """A model that states how far its answers may be off."""

    def error(self, condensed: Condensed) -> StateError | None:
        """Bounds of the error at a state; None where the model states none."""
        ...
