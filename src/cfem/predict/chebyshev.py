"""Values of a multivariate Chebyshev basis T_k(z) = prod_i T_{k_i}(z_i)."""

import numpy as np


def polynomials(z: np.ndarray, degree: int) -> np.ndarray:
    """(degree + 1, *z.shape) T_0 ... T_degree of every entry, also outside [-1, 1].

    Doubles the table by T_{m+j} = 2 T_m T_j - T_{m-j}, j = 1 ... m: a few array operations whatever the degree."""
    table = np.empty((max(degree, 1) + 1, *z.shape))
    table[0], table[1] = 1.0, z
    known = 1
    while known < degree:
        more = min(known, degree - known)
        np.multiply(2 * table[known], table[1 : more + 1], out=table[known + 1 : known + more + 1])
        table[known + 1 : known + more + 1] -= table[known - more : known][::-1]
        known += more
    return table[: degree + 1]


def basis(z: np.ndarray, indices: np.ndarray) -> np.ndarray:
    """(B, M) or (M,) basis functions at z (B, n) or (n,); indices (M, n): their degree in each coordinate."""
    table = polynomials(z.T, int(indices.max(initial=0)))  # (K, n, B) or (K, n)
    product = table[indices[:, 0], 0]
    for axis in range(1, indices.shape[1]):
        product = product * table[indices[:, axis], axis]
    return product.T
