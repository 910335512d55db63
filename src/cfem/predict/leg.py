"""A learned robot whose effectors are points that touch: it was sampled in the air, and yields to forces on them by
their locked compliance C, to first order:

    x = e(delta_a) + C(delta_a) f        lambda_a = lambda_0 - J^T f        J = de/ddelta_a"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from cfem.condensed.model import Model


@dataclass(frozen=True)
class LegState:
    """As `Equilibrium` has it."""

    delta_a: np.ndarray
    lambda_a: np.ndarray
    delta_c: np.ndarray
    lambda_c: np.ndarray
    converged: bool = True
    factorizations: int = 0


@dataclass(frozen=True)
class LearnedLeg:
    """`Touching`, placed by turn (3, 3) and shift (3,) mm. rest (k, 3) mm: of the points, in its own frame."""

    model: Model
    rest: np.ndarray
    turn: np.ndarray
    shift: np.ndarray

    @property
    def points(self) -> np.ndarray:
        return self.rest @ self.turn.T + self.shift

    def respond(self, actuators: Any, delta_c: np.ndarray, before: Any) -> tuple[LegState, np.ndarray]:
        """actuators: held at their targets."""
        at = self.model.at_displacement(actuators.target)
        J, rows = at.effector_jacobian, at.rows
        C = at.W[rows.e, rows.e] - J @ at.W[rows.a, rows.e]
        C = (C + C.T) / 2
        f = np.linalg.solve(C, delta_c - at.delta_e)
        return LegState(actuators.target, at.lambda_a - J.T @ f, delta_c, f), C
