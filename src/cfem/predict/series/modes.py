"""Linear maps of a skin's modes as series of their own: what markers do, with derivatives, in one product.

With s = s_0(t) + C_s,loads(t) w, the modes under loads w at fixed actuators, and a fixed map T (r, k) of them:

    T s = (T s_0)(t) + (T C_s,loads)(t) w

Both brackets are Chebyshev series of the model's inputs t, as s_0 and C are, and so are their derivatives. Combined
once, an answer costs one evaluation of the basis and one product with a small matrix. Values of the model's parameters
only shift t and scale C."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from cfem.condensed.packing import unpacking
from cfem.core.errors import InputError
from cfem.predict.series.chebyshev import Basis, union
from cfem.predict.series.derivatives import input_derivatives
from cfem.predict.series.skin import LearnedSkin


@dataclass(frozen=True, eq=False)
class BoxMap:
    """Box coordinates z = t to_box_T + offset of displacements t (n_a,), at one value of a model's parameters.

    to_box_T: (n_a, n)
    offset: (n,) at these parameters
    softer: compliance of the robot over that of the reference
    reference: (n,) offset at parameters q = 0
    by_q: (n, n_q) derivative of the offset"""

    to_box_T: np.ndarray
    offset: np.ndarray
    softer: float
    reference: np.ndarray
    by_q: np.ndarray

    @classmethod
    def of(cls, arrays: Mapping[str, np.ndarray], n_a: int) -> "BoxMap":
        """Map of a model with these arrays, at q = 0."""
        to_box, offset = arrays["to_box"], arrays["offset"]
        return cls(np.ascontiguousarray(to_box[:, :n_a].T), offset, 1.0, offset, to_box[:, n_a:])

    def at(self, q: np.ndarray, softer: float) -> "BoxMap":
        """Map at parameters q (n_q,), in the model's coordinates, of a robot `softer` times as compliant."""
        return replace(self, offset=self.reference + self.by_q @ q, softer=softer)

    def __call__(self, t: np.ndarray) -> np.ndarray:
        return t @ self.to_box_T + self.offset


@dataclass(frozen=True, eq=False)
class ModeSeries:
    """Series of T s, s the modes of a skin, by displacements and loads.

    box: of the model's inputs, at the parameters of the robot
    basis: of all series
    coefficients: (M, (1 + n_w) r (1 + n_a)) of T s_0 and T C with their derivatives by delta_a
    shape: (r, 1 + n_w, 1 + n_a)"""

    box: BoxMap
    basis: Basis
    coefficients: np.ndarray
    shape: tuple[int, int, int]

    @classmethod
    def of(cls, skin: LearnedSkin, n_a: int, T: np.ndarray, effectors: int, loaded: np.ndarray) -> "ModeSeries":
        """Joined series of T s and of T C of the loaded rows, T (r, k), of a skin of form displacement. effectors:
        number of the model's effector rows; loaded: (n_w,) numbers of the rows with loads, effectors first, then
        modes."""
        arrays = skin.arrays
        if skin.form != "displacement":
            raise InputError("series of markers need a model of form displacement")
        r, n_w = len(T), len(loaded)
        columns = compliance_columns(len(skin), effectors, loaded)
        parts = [(arrays["indices"], T @ arrays["series"])]
        parts += [(arrays["compliance_indices"], T @ arrays["compliance"][column]) for column in columns]
        indices, series = joined(parts)  # (M, n), (1 + n_w, r, M)
        slopes = input_derivatives(indices, arrays["to_box"], n_a)
        flat = series.reshape(-1, len(indices)).T
        with_slopes = np.stack([flat, *(D @ flat for D in slopes)], axis=-1)  # (M, (1 + n_w) r, 1 + n_a)
        with_slopes = with_slopes.reshape(len(indices), 1 + n_w, r, 1 + n_a).swapaxes(1, 2)
        coefficients = np.ascontiguousarray(with_slopes.reshape(len(indices), -1))
        return cls(BoxMap.of(arrays, n_a), Basis(indices), coefficients, (r, 1 + n_w, 1 + n_a))

    def at(self, q: np.ndarray, softer: float) -> "ModeSeries":
        """Series of the robot with parameters q (n_q,), in the model's coordinates, and `softer` times its
        compliance."""
        return replace(self, box=self.box.at(q, softer))

    def __call__(self, t: np.ndarray, w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """T s (r,) and its derivatives (r, n_a + n_w) by t, then w, at t (n_a,) mm and w (n_w,) N."""
        r, width, deep = self.shape
        terms = (self.basis(self.box(t)) @ self.coefficients).reshape(r, width, deep)
        if width == 1:
            return terms[:, 0, 0], terms[:, 0, 1:]
        summed = terms[:, 0] + self.box.softer * w @ terms[:, 1:]
        return summed[:, 0], np.concatenate([summed[:, 1:], self.box.softer * terms[:, 1:, 0]], axis=1)


def compliance_columns(k: int, effectors: int, loaded: np.ndarray) -> list[np.ndarray]:
    """Places (k,) in a skin's array `compliance` of the k modes' compliance to each loaded row."""
    place = unpacking(k)
    return [
        np.arange(row * k, (row + 1) * k) if row < effectors else effectors * k + place[row - effectors]
        for row in loaded
    ]


def joined(parts: list[tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
    """Series (r, M_i) over index sets (M_i, n), each over all indices (M, n) that one of them has: (parts, r, M)."""
    indices, places = union(*(index_set for index_set, _ in parts))
    coefficients = np.zeros((len(parts), len(parts[0][1]), len(indices)))
    for number, ((_, series), place) in enumerate(zip(parts, places, strict=True)):
        coefficients[number][:, place] = series
    return indices.astype(np.int64), coefficients
