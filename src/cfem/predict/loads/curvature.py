"""d2C/dw2 of one model, where it has learned it: what it adds to the motion under a wrench, E[w, w, w] / 6, and to the
compliance, E[w, w] / 2.

It has n (n + 1) (n + 2) (n + 3) / 24 components and a series of many terms: a wrench contracts the coefficients before
the derivatives by delta_a are taken."""

from collections import Counter
from dataclasses import dataclass
from itertools import combinations_with_replacement
from math import factorial, prod

import numpy as np

from cfem.condensed.packing import unpacking
from cfem.predict.kinds.spectral import SpectralPredictor
from cfem.predict.series.chebyshev import Basis
from cfem.predict.series.derivatives import input_derivatives
from cfem.predict.series.energy import FOURTH, FOURTH_INDICES


class CurvatureSeries:
    """Series of d2C/dw2 of the first `watched` effector rows of a model that has learned it."""

    def __init__(self, model: SpectralPredictor, watched: int):
        """Prepares the basis with its first and second derivatives, and the monomials of wrenches."""
        indices, n_a = model.arrays[FOURTH_INDICES].astype(np.int64), model.rows.n_a
        by_s = input_derivatives(indices, model.arrays["to_box"], n_a)
        second = [by_s[j] @ by_s[i] for i in range(n_a) for j in range(n_a)]
        self._slopes = np.hstack([np.eye(len(indices)), *(slope.toarray() for slope in (*by_s, *second))])
        self._basis, self._box = Basis(indices), model.box
        self._coefficients = np.ascontiguousarray(model.arrays[FOURTH].T)
        self.watched = watched
        places = unpacking(model.rows.n_e, 4)[:watched, :watched, :watched, :watched]
        self._triples, self._pairs = (_Monomials(watched, degree) for degree in (3, 2))
        self._of_triple = places[:, *self._triples.rows]  # (watched, number)
        self._of_pair = places[:, :, *self._pairs.rows]

    def at(self, delta_a: np.ndarray) -> "HeldCurvature":
        """Curvature at delta_a (n_a,) mm, for any wrench."""
        values = self._basis(self._box(delta_a))
        return HeldCurvature(self, (values @ self._slopes).reshape(-1, len(values)), values @ self._coefficients)

    def cubic(self, slopes: np.ndarray, w: np.ndarray) -> np.ndarray:
        spread = np.zeros((self._coefficients.shape[1], len(w)))
        spread[self._of_triple, np.arange(len(w))[:, None]] = self._triples(w)
        return slopes @ (self._coefficients @ spread)

    def square(self, packed: np.ndarray, w: np.ndarray) -> np.ndarray:
        return packed[self._of_pair] @ self._pairs(w)


@dataclass(frozen=True)
class HeldCurvature:
    """At one delta_a. slopes (1 + n + n n, M): the basis and its first and second derivatives; packed: the value."""

    series: CurvatureSeries
    slopes: np.ndarray
    packed: np.ndarray

    @property
    def watched(self) -> int:
        return self.series.watched

    def cubic(self, w: np.ndarray) -> np.ndarray:
        """E[w, w, w] / 6 and its derivatives, (1 + n + n n, watched)."""
        return self.series.cubic(self.slopes, w)

    def square(self, w: np.ndarray) -> np.ndarray:
        """E[w, w] / 2, (watched, watched)."""
        return self.series.square(self.packed, w)


class _Monomials:
    """Monomials w_i w_j ... of n numbers, i <= j <= ..., each over the factorials of how often its numbers occur: the
    terms of a symmetric form of that degree over the factorial of the degree."""

    def __init__(self, n: int, degree: int):
        terms = list(combinations_with_replacement(range(n), degree))
        self.rows = np.array(terms).T
        self._over = np.array([prod(factorial(often) for often in Counter(term).values()) for term in terms])

    def __call__(self, w: np.ndarray) -> np.ndarray:
        return w[self.rows].prod(axis=0) / self._over
