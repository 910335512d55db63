"""Linear least squares for nested sets of columns, by QR of blocks: any number of rows, one pass over them.

The triangular factor R of [A b] holds all there is to know: the solution with the first M columns is one triangular
solve, the residual |A x - b| of any x is |R_A x - R_b|, and the factor of two blocks of rows is that of their factors
one above the other (Demmel, Grigori, Hoemmen, Langou 2012, tall skinny QR)."""

from collections.abc import Iterable, Sequence

import numpy as np
from scipy.linalg import solve_triangular

from cfem.predict.series.chebyshev import basis
from cfem.surrogate.series.chebyshev import index_set

SINGULAR = 1e-13  # of the largest diagonal entry: columns that depend on those before them


def triangular(blocks: Iterable[np.ndarray]) -> np.ndarray:
    """R (at most columns, columns) of all blocks (rows, columns) of [A b] together."""
    R = None
    for block in blocks:
        R = np.linalg.qr(block if R is None else np.vstack([R, block]), mode="r")
    return R


def solve_nested(R: np.ndarray, outputs: int, counts: Sequence[int]) -> list[np.ndarray | None]:
    """Solutions (M, outputs) with the first M columns, for every M in counts; None where these are dependent. R: of [A
    b] with b the last `outputs` columns."""
    columns = R.shape[1] - outputs
    diagonal = np.abs(np.diag(R[:, :columns]))
    solutions = []
    for M in counts:
        sound = len(diagonal) >= M and diagonal[:M].min() > SINGULAR * diagonal[:M].max()
        solutions.append(solve_triangular(R[:M, :M], R[:M, columns:], check_finite=False) if sound else None)
    return solutions


def residual_square(R: np.ndarray, outputs: int, solution: np.ndarray) -> float:
    """|A x - b|^2 of the rows that R stands for, x being zero beyond the solution's first columns."""
    columns = R.shape[1] - outputs
    return float(((R[:, : len(solution)] @ solution - R[:, columns:]) ** 2).sum())


DECAYS = (0.3, 0.4, 0.5, 0.6, 0.7)  # of the coefficients from degree to degree
DEGREE, TERMS = 6, 100  # the most
ROUNDING = 1e-8  # of the kernel's largest value: what values are known to


def least_norm(z: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Indices (M, n), coefficients (M, q), and the root mean square error of states left out over that of the values;
    z (m, n), values (m, q)."""
    indices, order = index_set(np.ones(z.shape[1]), TERMS, DEGREE)
    A, trials = basis(z, indices), []
    for decay in DECAYS:
        weighted = A * decay**order
        K = weighted @ weighted.T
        inverse = np.linalg.inv(K + ROUNDING * K.max() * np.eye(len(z)))
        solved = inverse @ values
        left = np.linalg.norm(solved / np.diag(inverse)[:, None])
        trials.append((float(left), (decay**order)[:, None] * (weighted.T @ solved)))
    error, coefficients = min(trials, key=lambda trial: trial[0])
    return indices, coefficients, error / max(float(np.linalg.norm(values)), 1e-300)
