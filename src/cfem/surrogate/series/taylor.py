"""Functions near a point as truncated Taylor series: their sums, products and sines carry every derivative that is
asked for, exactly.

A series has along its first axis one coefficient a derivative i, f_i = (derivative i of f) / factorials[i]. Products
are then convolutions: (f g)_i is the sum of f_j g_k over all j, k whose axes together are those of i (Griewank and
Walther, Evaluating Derivatives, 2008, chapter 13)."""

from itertools import product
from math import factorial, prod

import numpy as np

Derivative = tuple[int, ...]  # the axes by which is derived, ascending: () the value itself, (0, 2) d2/dz0 dz2
HIGHEST_ORDER = 3


class Taylor:
    """The series with k stated derivatives: () first, and with each one all those that it goes through.

    factorials: (k,); terms: (k, k) at [i, k] the j whose product with k counts towards i, or k where there is none."""

    def __init__(self, derivatives: tuple[Derivative, ...]):
        """Finds which products of two derivatives count towards which."""
        if max(map(len, derivatives)) > HIGHEST_ORDER:
            raise ValueError(f"{derivatives}: series end at order {HIGHEST_ORDER}")
        position = {axes: i for i, axes in enumerate(derivatives)}
        self.factorials = np.array([float(prod(factorial(axes.count(i)) for i in set(axes))) for axes in derivatives])
        terms = {
            (position[joined], j, k)
            for (j, f), (k, g) in product(enumerate(derivatives), repeat=2)
            if (joined := tuple(sorted(f + g))) in position
        }
        self.terms = np.full((len(derivatives), len(derivatives)), len(derivatives))
        for i, j, k in terms:
            self.terms[i, k] = j
        self._beyond_value = sorted(term for term in terms if term[1])
        self._nilpotent = [term for term in self._beyond_value if term[2]]

    def multiply(self, f: np.ndarray, g: np.ndarray) -> np.ndarray:
        """The series (k, ...) of f g."""
        out = f[0] * g
        for i, j, k in self._beyond_value:
            out[i] += f[j] * g[k]
        return out

    def correlate(self, f: np.ndarray, h: np.ndarray) -> np.ndarray:
        """Product (k, ...) of the transpose of g -> multiply(f, g) with h."""
        out = f[0] * h
        for i, j, k in self._beyond_value:
            out[k] += f[j] * h[i]
        return out

    def sine_cosine(self, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The series of sin f and cos f: with f = f_0 + d, d^4 = 0, cos d = 1 - d^2 / 2 and sin d = d - d^3 / 6."""
        sine, cosine = np.sin(f[0]), np.cos(f[0])
        d = f.copy()
        d[0] = 0.0
        d2 = self._nilpotent_product(f, f)
        even, odd = -d2 / 2, d - self._nilpotent_product(d2, f) / 6
        even[0] = 1.0
        return sine * even + cosine * odd, cosine * even - sine * odd

    def _nilpotent_product(self, f: np.ndarray, g: np.ndarray) -> np.ndarray:
        """Product (f - f_0) (g - g_0)."""
        out = np.zeros_like(f)
        for i, j, k in self._nilpotent:
            out[i] += f[j] * g[k]
        return out
