"""The equations of a robot at one place, their factored tangent, and what a solve has cost."""

from dataclasses import dataclass, field

import numpy as np

from cfem.constraint.rod_row import Strained
from cfem.mechanics.body import BodyResponse
from cfem.mechanics.factorization import Factor


@dataclass
class SolveCost:
    """Work that a solve has done so far; halvings: load steps that failed, after which a shorter one came."""

    iterations: int = 0
    factorizations: int = 0
    steps: int = 0
    halvings: int = 0


@dataclass(frozen=True)
class Evaluation:
    """The equations at one x and element pressure p.

    force: (n_dof,) N internal less the constant loads' share; delta: (n,); H: (n_dof, n) gradients of delta;
    strained: of the rows that act on a rod's strains"""

    x: np.ndarray
    pressure: np.ndarray
    load: float
    response: BodyResponse
    force: np.ndarray
    delta: np.ndarray
    H: np.ndarray
    strained: tuple[Strained, ...] = field(default=(), kw_only=True)

    def residual(self, lam: np.ndarray) -> np.ndarray:
        """Residual (n_dof,) N on the unknowns."""
        return self.force - self.H @ lam


@dataclass(frozen=True)
class Tangent:
    """A factored at one state, with the gradient of theta_mean V that the element pressures need."""

    factor: Factor
    dtheta: np.ndarray
