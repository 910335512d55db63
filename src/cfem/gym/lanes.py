"""Chebyshev series of many robots at once: compiled loops over lanes, a robot in each.

The exported C sums the same series one robot after the other, which takes as long with one actuator and two to three
times as long with two to four (benchmarks/gym_series.py). It needs a C compiler too; numba brings its own."""

from typing import NamedTuple

import numpy as np
from numba import njit

import cfem.mechanics.compiling  # noqa: F401  says so while it compiles

LANES = 64  # robots whose series are summed side by side


class LaneSeries(NamedTuple):
    """Chebyshev series for the loops.

    to_box, offset: (n, n) and (n,)
    first, axis, degree: term m is the product of the factors first[m] to first[m + 1]: T of degree[k] of input axis[k]
    values: (outputs, terms), each padded with zeros to a multiple of 2 and of 4
    highest: the largest degree"""

    to_box: np.ndarray
    offset: np.ndarray
    first: np.ndarray
    axis: np.ndarray
    degree: np.ndarray
    values: np.ndarray
    highest: int

    @classmethod
    def of(cls, to_box: np.ndarray, offset: np.ndarray, indices: np.ndarray, rows: np.ndarray) -> "LaneSeries":
        """Series in lanes from indices (terms, n) and rows (outputs, terms)."""
        outputs, terms = rows.shape
        values = np.zeros((outputs + outputs % 2, terms + -terms % 4))
        values[:outputs, :terms] = rows
        first = np.concatenate([[0], np.cumsum((indices > 0).sum(axis=1))])
        term, axis = np.nonzero(indices)
        degree = indices[term, axis].astype(np.int64)
        to_box, offset = (np.ascontiguousarray(array, float) for array in (to_box, offset))
        return cls(to_box, offset, first, axis, degree, values, max(int(indices.max()), 1))


class Sums(NamedTuple):
    """Room for a series: table (n, highest + 1, LANES) of polynomials, basis (terms, LANES), sums (outputs, LANES)."""

    table: np.ndarray
    basis: np.ndarray
    sums: np.ndarray


@njit(cache=True, error_model="numpy")
def room_of(series, n):
    """Room for the sums of a series of n inputs."""
    outputs, terms = series.values.shape
    return Sums(np.empty((n, series.highest + 1, LANES)), np.zeros((terms, LANES)), np.empty((outputs, LANES)))


@njit(cache=True, fastmath=True, error_model="numpy")
def fill_basis(t, series, table, basis):
    """Fills basis (terms, LANES) at inputs t (n, LANES); table (n, highest + 1, LANES): room."""
    n = t.shape[0]
    for i in range(n):
        x = table[i, 1]
        for b in range(LANES):
            table[i, 0, b] = 1
            x[b] = series.offset[i]
        for j in range(n):
            coefficient = series.to_box[i, j]
            for b in range(LANES):
                x[b] += coefficient * t[j, b]
        for k in range(2, table.shape[1]):
            new, last, before = table[i, k], table[i, k - 1], table[i, k - 2]
            for b in range(LANES):
                new[b] = 2 * x[b] * last[b] - before[b]
    for m in range(len(series.first) - 1):
        row, begin, end = basis[m], series.first[m], series.first[m + 1]
        if begin == end:
            for b in range(LANES):
                row[b] = 1
            continue
        factor = table[series.axis[begin], series.degree[begin]]
        for b in range(LANES):
            row[b] = factor[b]
        for k in range(begin + 1, end):
            factor = table[series.axis[k], series.degree[k]]
            for b in range(LANES):
                row[b] *= factor[b]


@njit(cache=True, fastmath=True, error_model="numpy")
def add_up(values, basis, out):
    """Sums out (outputs, LANES) = values @ basis, two rows and four terms at a time, which keeps sums in registers."""
    out[:] = 0
    for m in range(0, basis.shape[0], 4):
        b0, b1, b2, b3 = basis[m], basis[m + 1], basis[m + 2], basis[m + 3]
        for j in range(0, out.shape[0], 2):
            first_row, second_row = out[j], out[j + 1]
            c0, c1, c2, c3 = values[j, m], values[j, m + 1], values[j, m + 2], values[j, m + 3]
            d0, d1, d2, d3 = values[j + 1, m], values[j + 1, m + 1], values[j + 1, m + 2], values[j + 1, m + 3]
            for b in range(LANES):
                v0, v1, v2, v3 = b0[b], b1[b], b2[b], b3[b]
                first_row[b] += c0 * v0 + c1 * v1 + c2 * v2 + c3 * v3
                second_row[b] += d0 * v0 + d1 * v1 + d2 * v2 + d3 * v3
