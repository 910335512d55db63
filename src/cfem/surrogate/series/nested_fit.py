"""Series of nested index sets, fitted at once and judged by the states that each fit leaves out."""

from itertools import pairwise

import numpy as np

from cfem.predict.series.derivatives import derivative_matrices
from cfem.surrogate.series.chebyshev import design_rows
from cfem.surrogate.series.least_squares import residual_square, solve_nested, triangular
from cfem.surrogate.series.observations import Derivative

BLOCK = 4_000_000  # entries of a block of the least-squares matrix
FEW_TERMS = 600  # up to which every fold judges


def level_counts(order: np.ndarray, smooth: bool) -> list[int]:
    """Sizes of the nested sets to try, of indices sorted by `order` (M,): whole degrees, or, for weighted ones, steps
    of a quarter in number."""
    ends = [
        i + 1 for i, (order_below, order_above) in enumerate(pairwise(order)) if order_above > order_below + 1e-9
    ] + [len(order)]
    if not smooth:
        return ends
    counts = [ends[0]]
    for end in ends[1:]:
        if end >= 1.25 * counts[-1] or end == ends[-1]:
            counts.append(end)
    return counts


def try_counts(
    z: np.ndarray,
    derivatives: tuple[Derivative, ...],
    targets: np.ndarray,
    divisors: np.ndarray,
    indices: np.ndarray,
    counts: list[int],
    folds: int,
) -> list[tuple[float, np.ndarray]]:
    """Relative root mean square error of states left out, and coefficients fitted to all states, for every count."""
    m, k, outputs = targets.shape
    members = [np.arange(m)[np.arange(m) % folds == fold] for fold in range(folds)]
    left_out = [triangular(blocks(z[rows], derivatives, targets[rows], divisors, indices)) for rows in members]
    everything = triangular(left_out)
    solutions = solve_nested(everything, outputs, counts)
    # many columns make the factors of all but one fold the dearest part: one fold then has to do
    judged = range(folds) if len(indices) <= FEW_TERMS else range(1)
    squares, count = np.zeros(len(counts)), 0
    for fold in judged:
        others = triangular(left_out[:fold] + left_out[fold + 1 :])
        for number, solution in enumerate(solve_nested(others, outputs, counts)):
            squares[number] += np.inf if solution is None else residual_square(left_out[fold], outputs, solution)
        count += len(members[fold]) * k * outputs
    errors = np.sqrt(squares / count)
    return [
        (np.inf if solution is None else float(error), solution)
        for error, solution in zip(errors, solutions, strict=True)
    ]


def values_left_out(
    z: np.ndarray,
    derivatives: tuple[Derivative, ...],
    scaled: tuple[np.ndarray, np.ndarray],
    indices: np.ndarray,
    folds: int,
) -> float:
    """Root mean square error of the values alone, the first of the derivatives, at states left out of a fit with these
    indices (M, n): relative to their standard deviation."""
    targets, divisors = scaled
    square = 0.0
    for fold in range(folds):
        rest = np.arange(len(z)) % folds != fold
        R = triangular(blocks(z[rest], derivatives, targets[rest], divisors, indices))
        (solution,) = solve_nested(R, targets.shape[2], [len(indices)])
        if solution is None:
            return np.inf
        values = design_rows(z[~rest], indices, derivatives[:1])[:, 0] @ solution / divisors[0]
        square += float(((values - targets[~rest, 0]) ** 2).sum())
    return float(np.sqrt(square / targets[:, 0].size))


def blocks(
    z: np.ndarray, derivatives: tuple[Derivative, ...], targets: np.ndarray, divisors: np.ndarray, indices: np.ndarray
):
    """Rows [A b] of the least-squares problem, some states at a time."""
    D = derivative_matrices(indices)
    at_once = max(1, BLOCK // (len(derivatives) * len(indices)))
    for first in range(0, len(z), at_once):
        part = slice(first, first + at_once)
        design = design_rows(z[part], indices, derivatives, D) / divisors[:, None]
        rows = np.concatenate([design, targets[part]], axis=2)
        yield rows.reshape(-1, rows.shape[2])
