"""Does a state satisfy the law? Residuals from the forces and motions alone, whoever found them.

All are dimensionless, in the problem's own units of length and force (`problem.Units`), or, where the state is
larger, in its largest force and gap."""

from dataclasses import dataclass, fields

import numpy as np

from cfem.contact.law.problem import ContactProblem, Law


@dataclass(frozen=True)
class Residuals:
    """Violations of the law by B states at once, dimensionless; each is (B, m) except balance (B,).

    gap: how far a point lies inside, or, bilateral, is anywhere but at 0
    force: how strongly a point is pulled, or carries friction that the law does not know
    complementarity: the smaller of gap and normal force
    cone: friction beyond mu lambda_n
    dissipation: friction that does less work than the law demands, or is not opposed to the slip; 0 where nothing slips
    balance: of the object's forces"""

    gap: np.ndarray
    force: np.ndarray
    complementarity: np.ndarray
    cone: np.ndarray
    dissipation: np.ndarray
    balance: np.ndarray

    @property
    def points(self) -> np.ndarray:
        """Worst residual (B, m) of each point."""
        return np.max([self.gap, self.force, self.complementarity, self.cone, self.dissipation], axis=0)

    @property
    def largest(self) -> np.ndarray:
        """Largest residual (B,) of each state, NaN where it holds one."""
        return np.maximum(self.points.max(axis=1), self.balance)


@dataclass(frozen=True)
class Check:
    """Residuals of one state, the largest over its points each; see `Residuals`."""

    gap: float
    force: float
    complementarity: float
    cone: float
    dissipation: float
    balance: float

    @property
    def largest(self) -> float:
        return float(np.max([getattr(self, each.name) for each in fields(self)]))

    def valid(self) -> bool:
        return self.largest <= 1e-8  # NaN is not valid


def check(problem: ContactProblem, law: Law, lam: np.ndarray, xi: np.ndarray | None = None) -> Check:
    """Residuals of one state: forces lam (3m,) N, motion xi (k,) of the object, None without one."""
    u = problem.units
    xi = np.zeros(0) if xi is None else xi
    violations = residuals(problem.normalised, law, lam[None] / u.force, xi[None] / u.motion)
    return Check(*(float(getattr(violations, each.name).max()) for each in fields(Residuals)))


def residuals(problem: ContactProblem, law: Law, lam: np.ndarray, xi: np.ndarray) -> Residuals:
    """Residuals of states lam (B, 3m) and xi (B, k) of a normalised problem."""
    gap = problem.gap(lam, xi)
    length = np.maximum(1.0, np.abs(gap).max(axis=1))[:, None]
    force = np.maximum(1.0, np.abs(lam).max(axis=1))[:, None]
    terms = np.abs(lam) @ np.abs(problem.motion) + np.abs(problem.load)
    imbalance = np.abs(lam @ problem.motion - problem.load) / np.maximum(1.0, terms)
    balance = imbalance.max(axis=1, initial=0.0)
    g, f = (each.reshape(-1, problem.m, 3) for each in (gap / length, lam / force))
    zero = np.zeros(g.shape[:2])
    if law == "bilateral":
        return Residuals(np.abs(g).max(axis=2), zero, zero, zero, zero, balance)
    pressing = f[..., 0]
    overlap, pull = np.maximum(0.0, -g[..., 0]), np.maximum(0.0, -pressing)
    complementarity = np.abs(np.minimum(g[..., 0], pressing))
    friction, slip = f[..., 1:], g[..., 1:]
    if law == "signorini" or problem.mu == 0:
        return Residuals(overlap, np.maximum(pull, np.abs(friction).max(axis=2)), complementarity, zero, zero, balance)
    limit = problem.mu * pressing
    beyond = np.linalg.norm(friction, axis=2) - limit
    speed = np.linalg.norm(slip, axis=2)
    dissipation = np.linalg.norm(friction * speed[..., None] + limit[..., None] * slip, axis=2)
    # Beyond the cone of a pulling point the force itself is the complaint.
    return Residuals(overlap, pull, complementarity, np.maximum(0.0, beyond), dissipation, balance)
