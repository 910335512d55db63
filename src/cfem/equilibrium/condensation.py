"""Condensation: W = H A^-1 H^T of all rows at an equilibrium, from a factor that may be of a state nearby.

With B = H^T (all rows as columns) and Z an approximation of A^-1 B, W = B^T Z + Z^T (B - A Z) errs by the square of
Z's error. Z comes from the nearby factor, refined against the true A until its residual is below 1e-7."""

import numpy as np

from cfem.condensed import Condensed
from cfem.equilibrium.problem import Cost, Evaluation, Problem, Tangent
from cfem.mechanics.assembly import symmetric_product
from cfem.mechanics.factorization import Factor

_ENOUGH = 1e-7


def condense(
    problem: Problem, at: Evaluation, lam: np.ndarray, tangent: Tangent, cost: Cost
) -> tuple[Condensed, np.ndarray, Factor]:
    """W and delta_free at an equilibrium; the response dx/dlambda (n, 3, n) mm/N of the active rows; the factor that
    gave them.

    Raises SingularMatrixError where A has to be factored anew and is singular."""
    robot = problem.robot
    B = np.hstack([problem.gradients(robot.effectors, at.x), at.H])
    data, _ = problem.stiffness(at, lam)
    factor = tangent.factor
    Z, rest, error = _refine(problem, data, factor, B)
    if error > _ENOUGH:
        factor = problem.factor(at, lam, cost).factor
        Z, rest, error = _refine(problem, data, factor, B)
    W = B.T @ Z + Z.T @ rest  # = B^T Z + Z^T B - Z^T A Z, symmetric but for the rounding of A Z (1.5e-12 on the finger)
    W = (W + W.T) / 2
    delta = np.concatenate([*(row.value(at.x) - row.rest for row in robot.effectors), at.delta])
    rows = robot.rows
    condensed = Condensed(rows, W, delta - W[:, rows.active] @ lam, lam.copy())
    response = np.stack([problem.kinematics.spread(at.x, column) for column in Z[:, rows.active].T], axis=-1)
    return condensed, response, factor


def _refine(problem: Problem, data: np.ndarray, factor: Factor, B: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Z, B - A Z and its relative size, after as many corrections by the factor as pay."""
    Z = factor.solve(B)
    rest = B - symmetric_product(problem.pattern, data, Z)
    error, before = _relative(rest, B), np.inf
    while error > _ENOUGH and error < 0.1 * before:
        Z = Z + factor.solve(rest)
        rest = B - symmetric_product(problem.pattern, data, Z)
        error, before = _relative(rest, B), error
    return Z, rest, error


def _relative(rest: np.ndarray, B: np.ndarray) -> float:
    size = np.maximum(np.linalg.norm(B, axis=0), np.finfo(float).tiny)  # a watched point may be one that is held
    return float((np.linalg.norm(rest, axis=0) / size).max())
