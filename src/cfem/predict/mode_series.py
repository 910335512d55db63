"""Linear maps of a skin's modes as series of their own: what markers do, with derivatives, in one product.

With s = s_0(t) + C_s,loads(t) w, the modes under loads w at fixed actuators, and a fixed map T (r, k) of them:

    T s = (T s_0)(t) + (T C_s,loads)(t) w

Both brackets are Chebyshev series of the model's inputs t, as s_0 and C are, and so are their derivatives. Combined
once, an answer costs one evaluation of the basis and one product with a small matrix. Values of the model's parameters
only shift t and scale C."""

import copy

import numpy as np

from cfem.core.errors import InputError
from cfem.predict.chebyshev import Basis
from cfem.predict.energy import unpacking
from cfem.predict.series import input_derivatives
from cfem.predict.skin import LearnedSkin


class ModeSeries:
    """Series of T s, s the modes of a skin of form displacement, by displacements and loads. `at` gives the values of
    the parameters of a model that has some.
    n_a: number of actuators
    T: (r, k)
    effectors: number of the model's effector rows
    loaded: (n_w,) numbers of the rows with loads, effectors first, then modes"""

    def __init__(self, skin: LearnedSkin, n_a: int, T: np.ndarray, effectors: int, loaded: np.ndarray):
        """Joins the series of T s and of T C of the loaded rows, each with its derivatives by delta_a."""
        arrays = skin.arrays
        if skin.form != "displacement":
            raise InputError("series of markers need a model of form displacement")
        self._to_box_T, self._first = np.ascontiguousarray(arrays["to_box"][:, :n_a].T), arrays["offset"]
        self._by_q, self._offset, self._softer = arrays["to_box"][:, n_a:], self._first, 1.0
        r, n_w = len(T), len(loaded)
        self._shape = (r, 1 + n_w, 1 + n_a)
        columns = compliance_columns(len(skin), effectors, loaded)
        parts = [(arrays["indices"], T @ arrays["series"])]
        parts += [(arrays["compliance_indices"], T @ arrays["compliance"][column]) for column in columns]
        indices, series = joined(parts)  # (M, n), (1 + n_w, r, M)
        slopes = input_derivatives(indices, arrays["to_box"], n_a)
        flat = series.reshape(-1, len(indices)).T
        with_slopes = np.stack([flat, *(D @ flat for D in slopes)], axis=-1)  # (M, (1 + n_w) r, 1 + n_a)
        with_slopes = with_slopes.reshape(len(indices), 1 + n_w, r, 1 + n_a).swapaxes(1, 2)
        self._basis, self._series = Basis(indices), np.ascontiguousarray(with_slopes.reshape(len(indices), -1))

    def at(self, q: np.ndarray, softer: float) -> "ModeSeries":
        """Series of the robot with parameters q (n_q,), in the model's coordinates, and `softer` times its
        compliance."""
        series = copy.copy(self)
        series._offset, series._softer = self._first + self._by_q @ q, softer
        return series

    def __call__(self, t: np.ndarray, w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """T s (r,) and its derivatives (r, n_a + n_w) by t, then w, at t (n_a,) mm and w (n_w,) N."""
        r, width, deep = self._shape
        terms = (self._basis(t @ self._to_box_T + self._offset) @ self._series).reshape(r, width, deep)
        if width == 1:
            return terms[:, 0, 0], terms[:, 0, 1:]
        summed = terms[:, 0] + self._softer * w @ terms[:, 1:]
        return summed[:, 0], np.concatenate([summed[:, 1:], self._softer * terms[:, 1:, 0]], axis=1)


def compliance_columns(k: int, effectors: int, loaded: np.ndarray) -> list[np.ndarray]:
    """(k,) places in a skin's array `compliance` of the k modes' compliance to each loaded row."""
    place = unpacking(k)
    return [
        np.arange(row * k, (row + 1) * k) if row < effectors else effectors * k + place[row - effectors]
        for row in loaded
    ]


def joined(parts: list[tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
    """Series (r, M_i) over index sets (M_i, n), each over all indices (M, n) that one of them has: (parts, r, M)."""
    indices, places = np.unique(np.concatenate([index_set for index_set, _ in parts]), axis=0, return_inverse=True)
    coefficients, first = np.zeros((len(parts), len(parts[0][1]), len(indices))), 0
    for number, (index_set, series) in enumerate(parts):
        coefficients[number][:, places.ravel()[first : first + len(index_set)]] = series
        first += len(index_set)
    return indices.astype(np.int64), coefficients
