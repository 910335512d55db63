"""Extrapolation of a model at a state, by the Christoffel function of its training states x_i:

    L(x)^2 = max p(x)^2 / mean p(x_i)^2    over the polynomials p of total degree k
           = b(x) . (mean b(x_i) b(x_i)^T)^-1 b(x)

whose mean over the x_i is the number of polynomials, M (Lasserre, Pauwels and Putinar, *The Christoffel-Darboux Kernel
for Data Analysis*, 2022). Fits of any kind err as a power of it: little among the data, more at their edges, and much
beyond. It needs the states alone, not the fit."""

from dataclasses import dataclass
from itertools import combinations_with_replacement
from math import comb

import numpy as np

from cfem.predict.series.chebyshev import Basis

DEGREE = 4  # at most: a power of L stands for higher ones
SHARE = 0.5  # polynomials per state
_SAME = 1e-6  # of the largest singular value: states do not differ along such a polynomial


@dataclass(frozen=True)
class Christoffel:
    """L relative to its root mean square over the states.

    to_box: (2, n) factor and offset of the box around the states; to_unit: (M, r) from the basis to orthonormal
    polynomials, over the root of their number"""

    to_box: np.ndarray
    basis: Basis
    to_unit: np.ndarray

    @classmethod
    def of(cls, states: np.ndarray) -> "Christoffel":
        """Function of states (m, n)."""
        low, high = states.min(axis=0), states.max(axis=0)
        factor = 2 / np.where(high > low, high - low, 1.0)
        to_box, n = np.stack([factor, -factor * (low + high) / 2]), states.shape[1]
        degree = max(k for k in range(DEGREE + 1) if k == 0 or comb(n + k, n) <= SHARE * len(states))
        chosen = [axes for k in range(degree + 1) for axes in combinations_with_replacement(range(n), k)]
        basis = Basis(np.array([np.bincount(np.array(axes, int), minlength=n) for axes in chosen]))
        _, size, axes = np.linalg.svd(basis(states * to_box[0] + to_box[1]) / np.sqrt(len(states)), full_matrices=False)
        kept = size > _SAME * size[0]
        return cls(to_box, basis, axes[kept].T / size[kept] / np.sqrt(kept.sum()))

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """Values (...,) at states x (..., n)."""
        return np.linalg.norm(self.basis(x * self.to_box[0] + self.to_box[1]) @ self.to_unit, axis=-1)
