"""The inverse step: which actuation, by the condensed model at the present state, brings the effectors to
their goal.

    minimise over lambda   |w (W_ea lambda + delta_free_e - goal)|^2 / 2 + |r (delta_a - preload)|^2 / 2
                           + (delta_a - delta_now)^T (S + d^2) (delta_a - delta_now) / 2
    subject to             bounds of lambda, of delta_a = W_aa lambda + delta_free_a, and of effector rows, if any

after Navez, Menager et al. 2025. w selects and weighs effector rows, r is a small regularisation that decides
where the effectors do not, and two terms are absent from the paper: S, the curvature of the effectors' map (see
`goal_search`), and d, the damping of Levenberg and Marquardt, which keeps actuators that the effectors leave the choice
from wandering among answers that are as good, and moves no answer."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cfem.condensed import Condensed
from cfem.control.search.qp import Backend, QpSolution, QpStatus, solve_qp
from cfem.core.errors import NumericalError


@dataclass(frozen=True)
class Limits:
    """Bounds (n_a, 2), low and high, +-inf where there is none.

    lambda_a: N
    delta_a: mm, the course of the actuators
    delta_e: (n_e, 2) of the effector rows, None without any"""

    lambda_a: np.ndarray
    delta_a: np.ndarray
    delta_e: np.ndarray | None = None

    def rows(self, W_aa: np.ndarray, W_ea: np.ndarray, free_a: np.ndarray, free_e: np.ndarray) -> tuple:
        """Bounded rows A (m, n_a) of lambda_a, and their lower and upper bounds (m,): the course, then effectors."""
        low, high = self.delta_a.T - free_a
        if self.delta_e is None:
            return W_aa, low, high
        chosen = np.isfinite(self.delta_e).any(axis=1)
        low_e, high_e = self.delta_e[chosen].T - free_e[chosen]
        return np.vstack([W_aa, W_ea[chosen]]), np.concatenate([low, low_e]), np.concatenate([high, high_e])

    def outside(self, delta_e: np.ndarray, lambda_a: np.ndarray, scale: np.ndarray | float = 1.0) -> float:
        """Sum of what lies beyond the bounds: forces times `scale` (n_a,), and effector rows in mm or N."""
        beyond = float((scale * _beyond(lambda_a, self.lambda_a)).sum())
        return beyond if self.delta_e is None else beyond + float(_beyond(delta_e, self.delta_e).sum())

    def off_course(self, delta_a: np.ndarray, scale: np.ndarray | float = 1.0) -> float:
        """Sum of displacements beyond the bounds, as shares of `scale` (n_a,)."""
        return float((_beyond(delta_a, self.delta_a) / scale).sum())

    @classmethod
    def of(cls, reach: np.ndarray, unilateral: np.ndarray) -> "Limits":
        """Limits of a robot: reach (n_a, 2) mm; unilateral (n_a,) actuators pull and do not push."""
        low = np.where(unilateral, 0.0, -np.inf)
        return cls(np.column_stack([low, np.full(len(low), np.inf)]), np.asarray(reach, float))

    def within(self, delta_a: np.ndarray, step: np.ndarray | float) -> "Limits":
        """The course cut down to what lies at most `step` from delta_a (n_a,): one number for all, or (n_a,)."""
        if np.all(step == np.inf):
            return self
        low, high = self.delta_a.T
        nearby = np.empty_like(self.delta_a)
        nearby[:, 0] = np.minimum(np.maximum(delta_a - step, low), high)
        nearby[:, 1] = np.minimum(np.maximum(delta_a + step, low), high)
        return Limits(self.lambda_a, nearby, self.delta_e)

    @cached_property
    def course(self) -> np.ndarray:
        """Length (n_a,) of each actuator's course, up to 0 where it has no end."""
        low, high = np.where(np.isfinite(self.delta_a), self.delta_a, 0.0).T
        return high - low


def _beyond(values: np.ndarray, bounds: np.ndarray) -> np.ndarray:
    return np.maximum(bounds[:, 0] - values, 0.0) + np.maximum(values - bounds[:, 1], 0.0)


@dataclass(frozen=True)
class Aim:
    """Task of the effectors.

    goal: (n_e,) mm from rest
    weights: (n_e,), 0 for rows that do not matter
    ridge: (n_a,) dimensionless, the regularisation r
    preload: mm, the course that it draws the actuators to
    damping: (n_a,) dimensionless, d, which holds them where they are; None: nothing does
    places: (n_e,) True for rows in mm, all unless given (forces have weights in mm/N)"""

    goal: np.ndarray
    weights: np.ndarray
    ridge: np.ndarray
    preload: np.ndarray | float = 0.0
    damping: np.ndarray | None = None
    places: np.ndarray | None = None

    def distance(self, delta_e: np.ndarray) -> float:
        """Distance (mm) between effectors (n_e,) and goal over the rows that matter."""
        matters = self.weights > 0 if self.places is None else (self.weights > 0) & self.places
        return float(np.linalg.norm((delta_e - self.goal)[matters]))

    def missed(self, delta_e: np.ndarray) -> float:
        """Weighted distance (mm) from the goal, of all rows."""
        return float(np.linalg.norm(self.weights * (delta_e - self.goal)))

    def cost(self, delta_e: np.ndarray, delta_a: np.ndarray) -> float:
        """Cost (mm^2) that the inverse step minimises, at a state."""
        missing, effort = self.weights * (delta_e - self.goal), self.ridge * (delta_a - self.preload)
        return 0.5 * float(missing @ missing + effort @ effort)


@dataclass(frozen=True)
class InverseStep:
    """Step to which the linearisation leads.

    lambda_a, delta_a: (n_a,) N and mm
    softened: whether no lambda within its bounds keeps the course, which was then widened by as little as possible
    qp: the program's own account"""

    lambda_a: np.ndarray
    delta_a: np.ndarray
    softened: bool
    qp: QpSolution


def inverse_step(
    now: Condensed, aim: Aim, limits: Limits, curvature_root: np.ndarray | None = None, backend: Backend = "active_set"
) -> InverseStep:
    """Actuation that brings the effectors nearest to their goal by the condensed model `now` of the present state,
    effectors from rest. curvature_root: R (k, n_a), S = R^T R.

    Raises NumericalError where the program has no trustworthy answer."""
    W_aa, free_a = now.W_aa, now.delta_free[now.rows.a]
    pull, wanted = aim.weights[:, None] * now.W_ea, aim.weights * (aim.goal - now.delta_free[now.rows.e])
    M, d = [pull, aim.ridge[:, None] * W_aa], [wanted, aim.ridge * (aim.preload - free_a)]
    if aim.damping is not None:
        M, d = [*M, aim.damping[:, None] * W_aa], [*d, aim.damping * (now.delta_a - free_a)]
    if curvature_root is not None:
        M, d = [*M, curvature_root @ W_aa], [*d, curvature_root @ (now.delta_a - free_a)]
    M, d = np.concatenate(M), np.concatenate(d)
    A, low, high = limits.rows(W_aa, now.W_ea, free_a, now.delta_free[now.rows.e])
    qp = solve_qp(M, d, A, low, high, limits.lambda_a, backend)
    softened = qp.status is QpStatus.INFEASIBLE
    if softened:
        nearest = _nearest(A, low, high, limits.lambda_a, backend)
        slack = 1e-9 * (high - low)[: len(free_a)].max()
        low, high = np.minimum(low, nearest - slack), np.maximum(high, nearest + slack)
        qp = solve_qp(M, d, A, low, high, limits.lambda_a, backend)
    _demand(qp)
    return InverseStep(qp.x, W_aa @ qp.x + free_a, softened, qp)


def _nearest(A: np.ndarray, low: np.ndarray, high: np.ndarray, box: np.ndarray, backend: Backend) -> np.ndarray:
    """Values (m,) A lambda, lambda in its box, that leave [low, high] by the least: one program in lambda and the place
    s within the bounds, minimising |A lambda - s|^2."""
    (m, n), nothing = A.shape, np.zeros(0)
    # Where any s with its lambda is as good, the program is flat: the solver takes one of them.
    apart = np.hstack([A, -np.eye(m)])
    within = np.vstack([box, np.column_stack([low, high])])
    qp = solve_qp(apart, np.zeros(m), np.zeros((0, n + m)), nothing, nothing, within, backend)
    _demand(qp)
    return A @ qp.x[:n]


def _demand(qp: QpSolution) -> None:
    if qp.status is not QpStatus.OPTIMAL:
        raise NumericalError(f"the inverse step failed: {qp.status.value} ({qp.kkt.missed:.1e} mm from the optimum)")
