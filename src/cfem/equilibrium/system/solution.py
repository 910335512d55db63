"""The answer of an equilibrium solve: a value that can be checked without trusting the solver."""

from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

from cfem.condensed import Condensed

if TYPE_CHECKING:
    from cfem.equilibrium.motion.inertia import Inertia
    from cfem.equilibrium.system.evaluation import Evaluation
    from cfem.equilibrium.system.problem import Problem
    from cfem.mechanics.factorization import Factor


class Status(Enum):
    """How a solve ended; the value is the sentence that the user reads."""

    CONVERGED = "converged"
    STEP_TOO_SMALL = "the load step fell below its smallest size, for no cause that the tangent stiffness shows"
    LIMIT_POINT = "a limit point: no equilibrium follows the path beyond this load"
    BIFURCATION = "a bifurcation: beyond this load the equilibrium buckles sideways"
    OUT_OF_REACH = "out of reach: the multipliers grow without bound, or an element is about to invert"
    TOO_MANY_ITERATIONS = "the iterations allowed were used up"
    INACCURATE = "the residual is above what the tolerance and the rounding of this stiffness allow"
    SINGULAR = "the tangent stiffness is singular: a free rigid motion, or actuators that depend on each other"
    UNSTABLE = "the equilibrium is unstable: the tangent stiffness has negative eigenvalues"
    NOT_FINITE = "the input or the state holds numbers that are not finite"


@dataclass(frozen=True)
class State:
    """All that a solve can start from.

    x: (n, 3) mm nodal positions
    pressure: (n_elements,) MPa, empty where the element has none, or to be found from x
    lam: (n,) N multipliers of the active rows, actuators then contacts
    load: share of the constant loads"""

    x: np.ndarray
    pressure: np.ndarray
    lam: np.ndarray
    load: float = 1.0


@dataclass(frozen=True)
class ParameterSlopes:
    """Derivatives by each of the robot's parameters, at constant delta_a and contacts free, each a unit of the
    parameter.

    psi: (n_q,) N mm
    lam: (n_a, n_q) N
    delta_e: (n_e, n_q) mm
    x: (n, 3, n_q) mm
    delta_s: (n_s, n_q) mm"""

    psi: np.ndarray
    lam: np.ndarray
    delta_e: np.ndarray
    x: np.ndarray
    delta_s: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))


@dataclass(frozen=True)
class Linearisation:
    """What a solve leaves for derivatives of its state, until its problem, or one on the same symbolic factorisation,
    is factorised again.

    at, lam: the state
    Z: (n_dof, n) = A^-1 H^T of all rows
    factor, data: of A
    C: (m, n_active) the rows that are held, dlambda = C^T dmu
    W: (n, n)"""

    problem: "Problem"
    at: "Evaluation"
    lam: np.ndarray
    Z: np.ndarray
    factor: "Factor"
    data: np.ndarray
    C: np.ndarray
    W: np.ndarray


@dataclass(frozen=True)
class Equilibrium:
    """One solved (or failed) state.

    delta: (n,) active displacements, those of the n_a actuators first
    delta_e: (n_e,) mm from the rest position
    slack: (n_a,) cables that carry nothing
    energy: Psi = U - f_ext . u (N mm) in the state
    residual: relative, recomputed after convergence
    rounding: the relative residual that double precision resolves here, below which nothing is asked
    tolerance: of the residual of a converged state, as asked for or as rounding allows
    path: share of the way to the actuation at which stability was lost or no further step was found, 1 where neither
    iterations, factorizations, steps: counts over the whole solve
    condensed: W and delta_free, None where it failed
    response: (n, 3, n_active) mm/N of the nodes to the active multipliers, for predictors
    delta_s: (n_s,) mm of the skin's rows
    push_response: (n, 3, k) mm/N of the nodes to forces on k other rows, about, where asked for
    dW: (n_active, n, n) dW/dlambda along the equilibrium path, where asked for, as all that follow
    slopes: by the robot's parameters
    inertia: what the rows need to move
    dC: (n_e, n_e, n_e) dC/dw of the effectors' compliance with the actuators held by a wrench on them
    d2C: the second derivative, packed (fourth_order.py)
    linear: what further derivatives start from"""

    status: Status
    state: State
    n_a: int
    delta: np.ndarray
    delta_e: np.ndarray
    slack: np.ndarray
    energy: float
    residual: float
    rounding: float
    tolerance: float
    path: float
    iterations: int
    factorizations: int
    steps: int
    seconds: float
    condensed: Condensed | None
    response: np.ndarray | None = None
    dW: np.ndarray | None = None
    dC: np.ndarray | None = None
    d2C: np.ndarray | None = None
    slopes: ParameterSlopes | None = None
    inertia: "Inertia | None" = None
    delta_s: np.ndarray = field(default_factory=lambda: np.zeros(0))
    push_response: np.ndarray | None = None
    linear: Linearisation | None = None

    @property
    def delta_a(self) -> np.ndarray:
        """Displacements (n_a,) mm of the actuators."""
        return self.delta[: self.n_a]

    @property
    def delta_c(self) -> np.ndarray:
        """Displacements (n_c,) mm of the contact rows."""
        return self.delta[self.n_a :]

    @property
    def lambda_a(self) -> np.ndarray:
        """Forces (n_a,) N of the actuators."""
        return self.state.lam[: self.n_a]

    @property
    def lambda_c(self) -> np.ndarray:
        """Forces (n_c,) N on the contact rows."""
        return self.state.lam[self.n_a :]

    @property
    def converged(self) -> bool:
        return self.status is Status.CONVERGED
