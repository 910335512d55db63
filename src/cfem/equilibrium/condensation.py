"""Condensation: W = H A^-1 H^T of all rows, and delta_free = delta - W lambda, at an equilibrium, from a factor that
may be of a state nearby.

With B = H^T (all rows as columns) and Z an approximation of A^-1 B, the error of W = B^T Z + Z^T (B - A Z) is the
square of Z's error. Z comes from the nearby factor, refined against the true A until its residual is small enough."""

from dataclasses import dataclass

import numpy as np

from cfem.condensed import Condensed
from cfem.equilibrium.system.evaluation import Evaluation, SolveCost, Tangent
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.robot import watched_displacements
from cfem.mechanics.assembly import symmetric_product
from cfem.mechanics.factorization import Factor

ENOUGH = 1e-7
EXACT = 1e-11  # for what has the error of Z itself


@dataclass(frozen=True)
class Condensation:
    """The condensed robot, and what made it.

    condensed: W and delta_free
    Z: (n_dof, n) = A^-1 H^T of all rows, motion of the unknowns by the multipliers
    y: (n_dof, k) = A^-1 of other right-hand sides
    factor: that gave them
    data: lower triangle of A"""

    condensed: Condensed
    Z: np.ndarray
    y: np.ndarray
    factor: Factor
    data: np.ndarray


def condense(
    problem: Problem,
    evaluation: Evaluation,
    lam: np.ndarray,
    tangent: Tangent,
    cost: SolveCost,
    others: np.ndarray,
    enough: float = ENOUGH,
) -> Condensation:
    """Condensation at an equilibrium. others: (n_dof, k) further right-hand sides; enough: relative error of Z. Raises
    SingularMatrixError where A has to be factorised again and is singular."""
    robot, n = problem.robot, problem.robot.rows.n
    B = np.hstack([problem.gradients(robot.watched, evaluation.x), evaluation.H, others])
    data, _ = problem.stiffness(evaluation, lam)
    factor = tangent.factor
    Z, rest, error = refined(problem, data, factor, B, enough)
    if error > enough:
        factor = problem.factor(evaluation, lam, cost).factor
        Z, rest, error = refined(problem, data, factor, B, enough)
    Z, y, rest, B = Z[:, :n], Z[:, n:], rest[:, :n], B[:, :n]
    W = B.T @ Z + Z.T @ rest  # = B^T Z + Z^T B - Z^T A Z, symmetric but for the rounding of A Z (1.5e-12 on the finger)
    W = (W + W.T) / 2
    delta = np.concatenate([watched_displacements(robot, evaluation.x), evaluation.delta])
    condensed = Condensed(robot.rows, W, delta - W[:, robot.rows.active] @ lam, lam.copy())
    return Condensation(condensed, Z, y, factor, data)


def refined(
    problem: Problem,
    data: np.ndarray,
    factor: Factor,
    B: np.ndarray,
    enough: float = ENOUGH,
    start: np.ndarray | None = None,
    pays: float = 0.1,
) -> tuple[np.ndarray, np.ndarray, float]:
    """Z = A^-1 B, B - A Z and its relative size, after as many corrections by the factor as pay until that is `enough`.

    data: of A; start: of Z, where one is known; pays: share of the residual that a correction may leave"""
    Z = factor.solve(B) if start is None else start
    rest = B - symmetric_product(problem.pattern, data, Z)
    error, before = _relative(rest, B), np.inf
    while error > enough and error < pays * before:
        Z = Z + factor.solve(rest)
        rest = B - symmetric_product(problem.pattern, data, Z)
        error, before = _relative(rest, B), error
    return Z, rest, error


def response(problem: Problem, evaluation: Evaluation, Z: np.ndarray, rows: slice) -> np.ndarray:
    """Motion (n, 3, k) mm/N of the nodes by the multipliers of these k rows."""
    return problem.kinematics.spread(evaluation.x, Z[:, rows])


def _relative(rest: np.ndarray, B: np.ndarray) -> float:
    size = np.maximum(np.linalg.norm(B, axis=0), np.finfo(float).tiny)  # a watched point may be one that is held
    return float((np.linalg.norm(rest, axis=0) / size).max())
