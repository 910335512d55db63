"""Eigenvalues and vectors of a symmetric 3 x 3 matrix, compiled."""

import math

import numpy as np
from numba import njit


@njit(cache=True, error_model="numpy")
def eigen3(A: np.ndarray, values: np.ndarray, vectors: np.ndarray) -> None:
    """Fills values (3,), in no order, and the columns of `vectors` (3, 3); A is overwritten.

    Cyclic Jacobi rotations (Golub and Van Loan, Matrix Computations, 4th ed., section 8.5): errors of a few units of
    rounding of the largest entry, and vectors orthogonal to rounding, however close the eigenvalues are."""
    for i in range(3):
        for j in range(3):
            vectors[i, j] = 1.0 if i == j else 0.0
    size = A[0, 0] ** 2 + A[1, 1] ** 2 + A[2, 2] ** 2 + 2.0 * (A[0, 1] ** 2 + A[0, 2] ** 2 + A[1, 2] ** 2)
    for _sweep in range(12):  # four or five are enough
        if A[0, 1] ** 2 + A[0, 2] ** 2 + A[1, 2] ** 2 <= 1e-34 * size:
            break
        for r in range(3):
            p, q = (r + 1) % 3, (r + 2) % 3
            if A[p, q] == 0.0:
                continue
            slope = 0.5 * (A[q, q] - A[p, p]) / A[p, q]
            t = math.copysign(1.0, slope) / (abs(slope) + math.sqrt(slope * slope + 1.0))
            c = 1.0 / math.sqrt(t * t + 1.0)
            s = t * c
            A[p, p] -= t * A[p, q]
            A[q, q] += t * A[p, q]
            A[p, q] = A[q, p] = 0.0
            rp, rq = A[r, p], A[r, q]
            A[r, p] = A[p, r] = c * rp - s * rq
            A[r, q] = A[q, r] = s * rp + c * rq
            for i in range(3):
                vp, vq = vectors[i, p], vectors[i, q]
                vectors[i, p] = c * vp - s * vq
                vectors[i, q] = s * vp + c * vq
    for i in range(3):
        values[i] = A[i, i]
