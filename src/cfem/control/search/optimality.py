"""Verdict on a goal that a search has missed: out of reach, or not converged.

At a state that satisfies the first-order optimality conditions of

    minimise |w (e(delta_a) - goal)|^2 / 2   subject to the bounds of lambda(delta_a), delta_a and effector rows

the robot linearised there, within the same bounds, comes no nearer to the goal: both problems have the same conditions.
So the test is one program, the inverse step without regularisation, damping and bound of the step: the share of the
miss by which it would come nearer is 1 - sin(angle), the angle being that between the miss and the directions in which
the bounds let the effectors go. It has no units, and is 0 at the nearest point of the reach, wherever a search stopped
and whatever held it there."""

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from cfem.condensed import Condensed
from cfem.control.search.inverse import Aim, Limits, inverse_step
from cfem.core.errors import NumericalError

NEARER = (
    5e-3  # of the miss: a robot that could come nearer by less is as near as it gets (miss and slopes at 84 degrees)
)
ARRIVED = 1e-4  # of how far a full stroke moves the effectors: a smaller miss is none


class Verdict(Enum):
    """What a search says of its goal; the value is the word in tables. MISPLACED: out of reach by the model, but the
    robot has been there."""

    REACHED = "reached"
    OUT_OF_REACH = "out of reach"
    MISPLACED = "misplaced by the model"
    NOT_CONVERGED = "not converged"


@dataclass(frozen=True)
class Optimality:
    """Condition of first order for a state of a search. missed: mm from the goal, weighted; nearest: mm to which the
    linearised robot could come, 0 where its program has no answer, which shows nothing."""

    missed: float
    nearest: float

    @classmethod
    def of(cls, condensed: Condensed, aim: Aim, limits: Limits) -> "Optimality":
        """Optimality of a state; limits: of the robot, not of one step."""
        free = replace(aim, ridge=np.zeros(len(condensed.delta_a)), damping=None)
        missed, nearest = aim.missed(condensed.delta_e), 0.0
        try:
            lam = inverse_step(condensed, free, limits).lambda_a
        except NumericalError:
            pass  # without an answer, `nearest` stays 0: the state is not called optimal
        else:
            nearest = aim.missed(condensed.W_ea @ lam + condensed.delta_free[condensed.rows.e])
        return cls(missed, nearest)

    @property
    def holds(self) -> bool:
        """True if, to first order, no move within the bounds brings the effectors nearer by more than a share NEARER of
        what is missed. It says nothing of minima elsewhere."""
        return self.missed - self.nearest <= NEARER * self.missed


def arrived(condensed: Condensed, aim: Aim, limits: Limits) -> bool:
    """True if the effectors are at the goal, to a small share of the way by which a full stroke moves them here."""
    moved = np.linalg.norm(aim.weights[:, None] * condensed.effector_jacobian, axis=0) * limits.course
    return aim.missed(condensed.delta_e) <= ARRIVED * float(moved.max())
