"""The inverse step: which actuation, by the condensed model at the present state, brings the effectors to
their goal.

    minimise over lambda   |w (W_ea lambda + delta_free_e - goal)|^2 / 2 + |r (delta_a - preload)|^2 / 2
                           + (delta_a - delta_now)^T (S + d^2) (delta_a - delta_now) / 2
    subject to             bounds of lambda, bounds of delta_a = W_aa lambda + delta_free_a

after Navez, Menager et al. 2025. w selects and weighs effector rows, r is a small regularisation that decides
where the effectors do not, and two terms are absent from the paper: S, the curvature of the effectors' map (see
`loop`), and d, the damping of Levenberg and Marquardt, which keeps actuators that the effectors leave the choice from
wandering among answers that are as good, and moves no answer."""

from dataclasses import dataclass, replace

import numpy as np

from cfem.condensed import Condensed
from cfem.control.qp import Backend, QpSolution, QpStatus, solve_qp
from cfem.core.errors import NumericalError


@dataclass(frozen=True)
class Limits:
    """Bounds (n_a, 2), low and high, +-inf where there is none. lambda_a: N; delta_a: mm, the course of the
    actuators."""

    lambda_a: np.ndarray
    delta_a: np.ndarray

    @classmethod
    def of(cls, reach: np.ndarray, unilateral: np.ndarray) -> "Limits":
        """From a robot: reach (n_a, 2) mm; unilateral (n_a,) actuators pull and do not push."""
        low = np.where(unilateral, 0.0, -np.inf)
        return cls(np.column_stack([low, np.full(len(low), np.inf)]), np.asarray(reach, float))

    def within(self, delta_a: np.ndarray, step: float) -> "Limits":
        """The course cut down to what lies at most `step` mm from delta_a (n_a,)."""
        low, high = self.delta_a.T
        nearby = np.column_stack([np.clip(delta_a - step, low, high), np.clip(delta_a + step, low, high)])
        return replace(self, delta_a=nearby)


@dataclass(frozen=True)
class Aim:
    """What the effectors should do. goal: (n_e,) mm from rest; weights: (n_e,), 0 for rows that do not matter;
    ridge: (n_a,) dimensionless, the regularisation r; preload: mm, the course that it draws the actuators to;
    damping: (n_a,) dimensionless, d, which holds them where they are."""

    goal: np.ndarray
    weights: np.ndarray
    ridge: np.ndarray
    preload: float = 0.0
    damping: np.ndarray | float = 0.0

    def distance(self, delta_e: np.ndarray) -> float:
        """mm between effectors (n_e,) and goal over the rows that matter."""
        return float(np.linalg.norm((delta_e - self.goal)[self.weights > 0]))

    def cost(self, delta_e: np.ndarray, delta_a: np.ndarray) -> float:
        """mm^2, what the inverse step minimises, at a state."""
        missing, effort = self.weights * (delta_e - self.goal), self.ridge * (delta_a - self.preload)
        return 0.5 * float(missing @ missing + effort @ effort)


def ridge_of(regularisation: float, reach: np.ndarray, length: float) -> np.ndarray:
    """(n_a,) weights such that full course (reach (n_a, 2) mm) costs `regularisation` times what missing by
    `length` mm costs."""
    return np.sqrt(regularisation) * length / np.abs(reach).max(axis=1)


@dataclass(frozen=True)
class InverseStep:
    """lambda_a (n_a,) N and delta_a (n_a,) mm that the linearisation asks for; `softened` where no lambda
    within its bounds keeps the course, which was then widened by as little as possible; qp: the program's own
    account."""

    lambda_a: np.ndarray
    delta_a: np.ndarray
    softened: bool
    qp: QpSolution


def inverse_step(
    now: Condensed, aim: Aim, limits: Limits, curvature: np.ndarray | None = None, backend: Backend = "active_set"
) -> InverseStep:
    """now: the condensed model at the present state, effectors from rest; curvature: S (n_a, n_a) positive
    semidefinite.

    Raises NumericalError where the program has no trustworthy answer."""
    W_aa, free_a = now.W_aa, now.delta_free[now.rows.a]
    pull, wanted = aim.weights[:, None] * now.W_ea, aim.weights * (aim.goal - now.delta_free[now.rows.e])
    M, d = [pull, aim.ridge[:, None] * W_aa], [wanted, aim.ridge * (aim.preload - free_a)]
    if np.any(aim.damping):
        held = np.broadcast_to(aim.damping, len(free_a))
        M, d = [*M, held[:, None] * W_aa], [*d, held * (now.delta_a - free_a)]
    if curvature is not None:
        values, vectors = np.linalg.eigh(curvature)
        root = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
        M, d = [*M, root @ W_aa], [*d, root @ (now.delta_a - free_a)]
    M, d = np.concatenate(M), np.concatenate(d)
    low, high = limits.delta_a.T - free_a
    qp = solve_qp(M, d, W_aa, low, high, limits.lambda_a, backend)
    softened = qp.status is QpStatus.INFEASIBLE
    if softened:
        nearest = _nearest(W_aa, low, high, limits.lambda_a, backend)
        slack = 1e-9 * (high - low).max()
        low, high = np.minimum(low, nearest - slack), np.maximum(high, nearest + slack)
        qp = solve_qp(M, d, W_aa, low, high, limits.lambda_a, backend)
    _demand(qp)
    return InverseStep(qp.x, W_aa @ qp.x + free_a, softened, qp)


def _nearest(W_aa: np.ndarray, low: np.ndarray, high: np.ndarray, box: np.ndarray, backend: Backend) -> np.ndarray:
    """(n_a,) W_aa lambda, lambda in its box, that leaves [low, high] by the least: one program in lambda and
    the place s in the course, minimising |W_aa lambda - s|^2."""
    n, nothing = len(low), np.zeros(0)
    # Where any s with its lambda is as good, the program is flat: the solver takes one of them.
    apart = np.hstack([W_aa, -np.eye(n)])
    within = np.vstack([box, np.column_stack([low, high])])
    qp = solve_qp(apart, np.zeros(n), np.zeros((0, 2 * n)), nothing, nothing, within, backend)
    _demand(qp)
    return W_aa @ qp.x[:n]


def _demand(qp: QpSolution) -> None:
    if qp.status is not QpStatus.OPTIMAL:
        raise NumericalError(f"the inverse step failed: {qp.status.value} ({qp.kkt.missed:.1e} mm from the optimum)")
