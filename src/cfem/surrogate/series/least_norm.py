"""A Chebyshev series through all values, of the least norm: for quantities of many components that states know no
derivatives of, so that a series of fewer terms than states is too short and one of more terms is not determined.

With the penalty sum_k |c_k|^2 / d^(2 |k|), |k| the total degree of term k, the series is c = P A^T (A P A^T)^-1 values,
P the penalty's inverse: interpolation by the kernel A P A^T (Wahba, *Spline Models for Observational Data*, 1990,
chapter 1). The decay d is the one with the least error at states left out, (K^-1 y)_i / (K^-1)_ii."""

import numpy as np

from cfem.predict.series.chebyshev import basis
from cfem.surrogate.series.chebyshev import index_set

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
