"""The first isochoric invariant I1bar = J^(-2/3) I1 from the displacement gradient, compiled; small strains keep their
digits.

With 2 E = m 1 + M, tr M = 0: I1 = 3 (1 + m), I2 = 3 (1 + m)^2 - |M|^2/2, J^2 = (1 + m)^3 (1 + x),
x = y + det M / (1 + m)^3, y = -|M|^2/2 / (1 + m)^2."""

import math

import numpy as np
from numba import njit

from cfem.mechanics.material.tensor import cofactor_change, double_strain, volume_change


@njit(cache=True, error_model="numpy")
def first_invariant(
    D: np.ndarray, cof_D: np.ndarray, M: np.ndarray, g: np.ndarray
) -> tuple[float, float, float, float, float]:
    """Invariants (J - 1, m, |M|^2, y, I1bar / 3 - 1); fills cof D, M and g = cof F, all (3, 3). Where J <= 0 the first
    alone means anything."""
    trace, higher = volume_change(D, cof_D)
    change = trace + higher
    if not 1.0 + change > 0.0:
        return change, 0.0, 0.0, 0.0, 0.0
    double_strain(D, M)
    mean = (M[0, 0] + M[1, 1] + M[2, 2]) / 3.0
    square = 0.0
    for i in range(3):
        M[i, i] -= mean
        for j in range(3):
            g[i, j] = cofactor_change(D, cof_D, trace, i, j) + (1.0 if i == j else 0.0)
            square += M[i, j] * M[i, j]
    det = (
        M[0, 0] * (M[1, 1] * M[2, 2] - M[1, 2] * M[1, 2])
        - M[0, 1] * (M[0, 1] * M[2, 2] - M[1, 2] * M[0, 2])
        + M[0, 2] * (M[0, 1] * M[1, 2] - M[1, 1] * M[0, 2])
    )
    scale = 1.0 + mean
    y = -0.5 * square / scale**2
    x = y + det / scale**3
    log = math.log1p(x) if x > -0.5 else 2.0 * math.log1p(change) - 3.0 * math.log1p(mean)
    return change, mean, square, y, math.expm1(-log / 3.0)
