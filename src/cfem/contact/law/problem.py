"""The contact problem of one linearisation: m points, three rows each (normal n, tangents t1, t2).

    gap = W lambda + free - G xi        G^T lambda = wrench

Signs: gap_n >= 0 is open; lambda_n >= 0 presses the two sides apart. The deformable side gives way by W lambda;
a rigid object, where there is one, moves by xi, its rows by G xi, and carries the load `wrench`: the contact
forces on it, -lambda, balance the external ones.

The laws: Signorini, *Sopra alcune questioni di elastostatica* (1933); Coulomb friction as in Acary and
Brogliato, *Numerical Methods for Nonsmooth Dynamical Systems* (2008), chapter 3."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from cfem.core.errors import SpecError

Law = Literal["bilateral", "signorini", "coulomb"]
"""bilateral: every gap and slip is 0, any force. signorini: gap_n >= 0, lambda_n >= 0, one of them 0, no tangential
force. coulomb: signorini along n, and |lambda_t| <= mu lambda_n; where the slip is not 0 it is opposed by the
largest friction: lambda_t = -mu lambda_n slip / |slip|."""


@dataclass(frozen=True)
class ContactProblem:
    """The contact problem of m points, three rows each.

    W: (3m, 3m) mm/N, symmetric, positive semidefinite
    free: (3m,) mm, normal gaps and, counted from where each point last stuck, tangential slips at zero contact force
    G, wrench: (3m, k) and (k,) N or N mm of an object with coordinates xi (k,) mm or rad; None without object
    mu: friction coefficient"""

    W: np.ndarray
    free: np.ndarray
    G: np.ndarray | None = None
    wrench: np.ndarray | None = None
    mu: float = 0.0

    def __post_init__(self) -> None:
        """Checks shapes, finiteness and friction."""
        n = len(self.free)
        if n == 0 or n % 3 or self.W.shape != (n, n):
            raise SpecError(f"contact: W is {self.W.shape} and free ({n},)", do="give three rows for every point")
        if (self.G is None) != (self.wrench is None):
            raise SpecError("contact: of an object both G and wrench are needed")
        if self.G is not None and (len(self.G) != n or self.G.shape[1:] != self.wrench.shape):
            raise SpecError(f"contact: G is {self.G.shape}, {n} rows and wrench {self.wrench.shape} are there")
        if not all(np.isfinite(array).all() for array in (self.W, self.free, self.motion, self.load)):
            raise SpecError("contact: the problem holds numbers that are not finite")
        demand_friction(self.mu)

    @property
    def m(self) -> int:
        return len(self.free) // 3

    @property
    def k(self) -> int:
        return self.motion.shape[1]

    @cached_property
    def motion(self) -> np.ndarray:
        """The motions G (3m, k) of the points by the object's, (3m, 0) without one."""
        return np.zeros((len(self.free), 0)) if self.G is None else self.G

    @cached_property
    def load(self) -> np.ndarray:
        return np.zeros(0) if self.wrench is None else self.wrench

    def gap(self, lam: np.ndarray, xi: np.ndarray) -> np.ndarray:
        """Gaps (..., 3m) mm of the points under forces lam (..., 3m) N and motions xi (..., k) of the object."""
        return lam @ self.W.T + self.free - xi @ self.motion.T

    @cached_property
    def units(self) -> "Units":
        return Units.of(self)

    @cached_property
    def normalised(self) -> "ContactProblem":
        """This problem in its own units."""
        u = self.units
        if self.G is None:
            return replace(self, W=self.W * (u.force / u.length), free=self.free / u.length)
        G = self.G * (u.motion / u.length)
        wrench = self.wrench * (u.motion / u.length / u.force)
        return replace(self, W=self.W * (u.force / u.length), free=self.free / u.length, G=G, wrench=wrench)


@dataclass(frozen=True)
class Units:
    """Units that make a problem dimensionless.

    length: mm, the largest of |free| and of what the load alone does to the compliance
    force: N, length over the largest compliance
    motion: (k,) mm or rad; unit motions shift the rows by one length"""

    length: float
    force: float
    motion: np.ndarray

    @classmethod
    def of(cls, problem: ContactProblem) -> "Units":
        """Units of a problem; where nothing yields, those of its gaps and its load."""
        compliance = float(np.diag(problem.W).max())
        column = np.sqrt((problem.motion**2).sum(axis=0))
        column[column == 0.0] = 1.0
        load = float(np.abs(problem.load / column).max(initial=0.0))
        if not compliance > 0:
            length = float(np.abs(problem.free).max()) or 1.0
            return cls(length, load or 1.0, length / column)
        length = max(float(np.abs(problem.free).max()), compliance * load) or 1.0
        return cls(length, length / compliance, length / column)


def demand_friction(mu: float) -> None:
    """SpecError where it is none."""
    if not 0 <= mu < np.inf:
        raise SpecError(f"contact: a coefficient of friction mu must be a finite number, 0 or more, not {mu}")
