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
    problem: Problem, at: Evaluation, lambda_a: np.ndarray, tangent: Tangent, cost: Cost
) -> tuple[Condensed, np.ndarray, Factor]:
    """W and delta_free at an equilibrium; the response dx/dlambda (n, 3, n_a) mm/N; the factor that gave them.

    Raises SingularMatrixError where A has to be factored anew and is singular."""
    robot = problem.robot
    B = np.hstack([problem.gradients(robot.effectors, at.x), at.H])
    data, _ = problem.stiffness(at, lambda_a)
    factor = tangent.factor
    Z, rest, error = _refine(problem, data, factor, B)
    if error > _ENOUGH:
        factor = problem.factor(at, lambda_a, cost).factor
        Z, rest, error = _refine(problem, data, factor, B)
    W = B.T @ Z + Z.T @ rest  # = B^T Z + Z^T B - Z^T A Z, symmetric but for the rounding of A Z (1.5e-12 on the finger)
    W = (W + W.T) / 2
    delta = np.concatenate([*(row.value(at.x) - row.rest for row in robot.effectors), at.delta_a])
    rows = robot.rows
    condensed = Condensed(rows, W, delta - W[:, rows.active] @ lambda_a, lambda_a.copy())
    response = np.stack([problem.spread(column) for column in Z[:, rows.a].T], axis=-1)
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
    return float((np.linalg.norm(rest, axis=0) / np.linalg.norm(B, axis=0)).max())
