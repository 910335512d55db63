"""Values of a multivariate Chebyshev basis T_k(z) = prod_i T_{k_i}(z_i)."""

from itertools import pairwise

import numpy as np


def polynomials(z: np.ndarray, degree: int) -> np.ndarray:
    """Polynomials (degree + 1, *z.shape), T_0 ... T_degree, of every entry, also outside [-1, 1].

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


def _of_one(z: list[float], degree: int) -> np.ndarray:
    """Values of `polynomials` at a few numbers, of one number after another: arrays would take longer."""
    table = []
    for value in z:
        before, now, twice = 1.0, value, 2.0 * value
        table += (before, now)
        for _ in range(degree - 1):
            before, now = now, twice * now - before
            table.append(now)
    return np.array(table)


class Basis:
    """The basis of `basis` for many queries: functions share their factors in the first half of the coordinates, and
    those in the second, so that most of a query is one product of two factors a function.

    indices: (M, n)"""

    def __init__(self, indices: np.ndarray):
        """Collects the distinct factors of the functions, in both halves of the coordinates."""
        self.indices, n = indices, indices.shape[1]
        self._degree = int(indices.max(initial=0))
        ends = [0, n] if n < 4 else [0, n // 2, n]
        self._factors, self._of_one = [], []
        for first, end in pairwise(ends):
            part, place = np.unique(indices[:, first:end], axis=0, return_inverse=True)
            self._factors.append((first, part, place.ravel()))
            of_one = part if len(ends) > 2 else indices
            table = np.ascontiguousarray(of_one.T) + (max(self._degree, 1) + 1) * np.arange(first, end)[:, None]
            self._of_one.append((table, place.ravel()))

    def __call__(self, z: np.ndarray) -> np.ndarray:
        """Values (..., M) of the functions at z (..., n)."""
        if z.ndim == 1:
            table = _of_one(z.tolist(), self._degree)
            if len(self._of_one) == 1:
                return np.multiply.reduce(table.take(self._of_one[0][0]))
            first, second = (np.multiply.reduce(table.take(part)).take(place) for part, place in self._of_one)
            return first * second
        if z.shape[:-1] == (1,):
            return self(z[0])[None]
        table = polynomials(z.T, self._degree)
        values = None
        for first, part, place in self._factors:
            factor = _product(table, part, first)[place]
            values = factor if values is None else values * factor
        return values.T


def basis(z: np.ndarray, indices: np.ndarray) -> np.ndarray:
    """Basis functions (B, M) or (M,) at z (B, n) or (n,); indices (M, n): their degree in each coordinate."""
    return _product(polynomials(z.T, int(indices.max(initial=0))), indices, 0).T


def _product(table: np.ndarray, indices: np.ndarray, first: int) -> np.ndarray:
    """Products (M, ...) of the columns of indices, which are those of the coordinates from `first` on."""
    product = table[indices[:, 0], first]
    for axis in range(1, indices.shape[1]):
        product = product * table[indices[:, axis], first + axis]
    return product


def union(*bases: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
    """Degrees (M, n) that are in any of the bases, and the place of each of theirs."""
    degrees, place = np.unique(np.vstack(bases), axis=0, return_inverse=True)
    return degrees, np.split(place.ravel(), np.cumsum([len(basis) for basis in bases])[:-1])
