"""The error of the contact of a learned robot, calibrated on finite elements that touch the same.

What forces do is the further off the further they bend the robot, and `ContactState.error` estimates how far. The error
of a state is factor L^power, where L is that estimate, as `cfem.condensed.model_error` has it of the place in the
domain."""

from dataclasses import dataclass

import numpy as np
from pydantic import Field

from cfem.condensed.model_error import ErrorBound
from cfem.core.reading import Data
from cfem.predict.contact.state import ContactState

LEAST = 1e-3  # of `ContactState.error`: below it the estimate says no more


class ContactError(Data):
    """Bounds of the error of the contact of one robot with one obstacle, of trusted states.

    force: of the sum of forces on the robot, relative to it; tip: of all effector points together, relative to how far
    forces move them
    probability: that a bound holds at a place like those of the calibration; places: of it; left_out: those that were
    not trusted, or where no state was found; friction: coefficient at these places"""

    probability: float = Field(gt=0, lt=1)
    places: int = Field(ge=1)
    left_out: int = Field(ge=0)
    friction: float = Field(ge=0)
    force: ErrorBound
    tip: ErrorBound


@dataclass(frozen=True)
class ContactBounds:
    """Bounds of the error of one contact state, infinite where it is not trusted.

    force: N, of the sum of forces; tip: mm, of all effector points together"""

    force: float
    tip: float


def bending(state: ContactState) -> float:
    """Measure L of the bounds, 1 at least: how far forces bend the robot beyond what is known of it."""
    return max(state.error, LEAST) / LEAST


def contact_error(stated: ContactError, state: ContactState, points: np.ndarray) -> ContactBounds:
    """Bounds of the first robot's error at a state. points: (n_e,) bool, effector rows that are no turns."""
    force, moved = sizes(state, points)
    if not state.converged or not state.trusted:
        return ContactBounds(np.inf, np.inf)
    L = np.array(bending(state))
    return ContactBounds(float(stated.force.at(L)) * force, float(stated.tip.at(L)) * moved)


def sizes(state: ContactState, points: np.ndarray) -> tuple[float, float]:
    """N, the sum of forces on the first robot, and mm by which they move its effector points."""
    return float(np.linalg.norm(state.forces.sum(axis=0))), float(np.linalg.norm(state.moved[0][points]))
