"""The answer of an equilibrium solve: a value that can be checked without trusting the solver."""

from dataclasses import dataclass
from enum import Enum

import numpy as np

from cfem.condensed import Condensed


class Status(Enum):
    """How a solve ended; the value is the sentence that the user reads."""

    CONVERGED = "converged"
    STEP_TOO_SMALL = "the load step fell below its smallest size: a limit point, or beyond what the robot can reach"
    TOO_MANY_ITERATIONS = "the iterations allowed were used up"
    SINGULAR = "the tangent stiffness is singular: a free rigid motion or a limit point"
    UNSTABLE = "the equilibrium is unstable: the tangent stiffness has negative eigenvalues"
    NOT_FINITE = "the input or the state holds numbers that are not finite"


@dataclass(frozen=True)
class State:
    """All that a solve can start from.

    x: (n, 3) mm nodal positions; pressure: (n_elements,) MPa, empty where the element has none; lambda_a: (n_a,) N."""

    x: np.ndarray
    pressure: np.ndarray
    lambda_a: np.ndarray


@dataclass(frozen=True)
class Equilibrium:
    """One solved (or failed) state.

    delta_a (n_a,) mm; delta_e (n_e,) mm from the rest position; slack (n_a,) cables that carry nothing;
    energy: Psi = U - f_ext . u (N mm) in the state; residual: relative, recomputed after convergence;
    iterations, factorizations, steps: counts over the whole solve; condensed: W and delta_free, None where it failed;
    dx_dlambda: (n, 3, n_a) mm/N response of the nodes to the active multipliers, for predictors."""

    status: Status
    state: State
    delta_a: np.ndarray
    delta_e: np.ndarray
    slack: np.ndarray
    energy: float
    residual: float
    iterations: int
    factorizations: int
    steps: int
    seconds: float
    condensed: Condensed | None
    dx_dlambda: np.ndarray | None = None

    @property
    def converged(self) -> bool:
        return self.status is Status.CONVERGED
