"""Total-degree index sets, and differentiation as a matrix on the coefficients of a Chebyshev series."""

from itertools import product
from math import comb

import numpy as np
from scipy.sparse import csr_array


def index_set(n: int, degree: int) -> np.ndarray:
    """(M, n) all k with k_1 + ... + k_n <= degree, lower degrees first: the set of a lower degree is a prefix."""
    if n == 1:
        return np.arange(degree + 1)[:, None]
    lists = [k for k in product(range(degree + 1), repeat=n) if sum(k) <= degree]
    return np.array(sorted(lists, key=lambda k: (sum(k), k)), dtype=np.int64)


def number_of_terms(n: int, degree: int) -> int:
    """Rows of `index_set(n, degree)`."""
    return comb(n + degree, n)


def derivative_matrices(indices: np.ndarray) -> list[csr_array]:
    """One (M, M) matrix an axis, with d/dz_i basis(z) = basis(z) @ D_i: column k holds the series of d T_k / dz_i.

    T_k' = 2 k (T_{k-1} + T_{k-3} + ...), the term T_0 halved. `indices` holds with every k all smaller ones."""
    position = {tuple(k): number for number, k in enumerate(indices.tolist())}
    matrices = []
    for axis in range(indices.shape[1]):
        entries, at_rows, at_columns = [], [], []
        for k, column in position.items():
            for lower in range(k[axis] - 1, -1, -2):
                at_rows.append(position[(*k[:axis], lower, *k[axis + 1 :])])
                at_columns.append(column)
                entries.append((2.0 if lower else 1.0) * k[axis])
        matrices.append(csr_array((entries, (at_rows, at_columns)), shape=(len(indices), len(indices))))
    return matrices
