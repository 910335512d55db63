"""What loads do to the forces of the actuators that hold a robot: a series of the actuators' displacements.

With the displacements e of the loaded rows and their compliance C at locked actuators, loads w leave the potential

    Pi(t, w) = Psi(t) - w . e(t) - w . C(t) w / 2        lambda_a = d Pi / d t

(Psi and e of the robot without these loads: the displacements e + C w are - d Pi / d w, so that the two derivatives
agree by Maxwell's theorem of reciprocity). A tension that changes at a fixed displacement thus tells of a push, where
the markers hardly move. A softer robot, whose Young's modulus is exact, has a smaller Psi and a larger C."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cfem.condensed.packing import unpacking
from cfem.predict.kinds.spectral import SpectralPredictor
from cfem.predict.series.chebyshev import Basis
from cfem.predict.series.derivatives import input_derivatives
from cfem.predict.series.energy import layout
from cfem.predict.series.modes import BoxMap, joined


@dataclass(frozen=True, eq=False)
class ForceSeries:
    """Forces of the actuators by displacements and loads.

    box: of the model's inputs, at the parameters of the robot
    basis: of all series
    coefficients: (M, (n_a + n_a^2) (1 + n_w + pairs)) first and second derivatives of Psi, e and C by delta_a
    n_a, n_w: numbers of actuators and of loaded rows
    pairs: rows i <= j of the entries of C"""

    box: BoxMap
    basis: Basis
    coefficients: np.ndarray
    n_a: int
    n_w: int
    pairs: tuple[np.ndarray, ...]

    @classmethod
    def of(cls, model: SpectralPredictor, loaded: np.ndarray) -> "ForceSeries":
        """Series of a model of form displacement. loaded (n_w,): numbers of rows, effectors first, then modes of its
        skin."""
        arrays, n_a = model.arrays, model.rows.n_a
        indices, series, pairs = potential_series(model, loaded)
        flat = series.T  # (M, 1 + n_w + pairs)
        by = input_derivatives(indices, arrays["to_box"], n_a)
        first = [D @ flat for D in by]
        second = [by[j] @ first[i] for i in range(n_a) for j in range(n_a)]
        coefficients = np.ascontiguousarray(np.stack([*first, *second], axis=1).reshape(len(indices), -1))
        entries = tuple(np.array(pairs, dtype=int).reshape(-1, 2).T)
        return cls(BoxMap.of(arrays, n_a), Basis(indices), coefficients, n_a, len(loaded), entries)

    @cached_property
    def _unpack(self) -> np.ndarray:
        return unpacking(self.n_w)

    def at(self, q: np.ndarray, softer: float) -> "ForceSeries":
        """The series of the robot with parameters q (n_q,), in the model's coordinates, and `softer` times its
        compliance."""
        return replace(self, box=self.box.at(q, softer))

    def __call__(self, t: np.ndarray, w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Forces lambda_a (n_a,) and their derivatives (n_a, n_a + n_w) by t, then w, at t (n_a,) mm and w (n_w,) N."""
        n_a, n_w, softer = self.n_a, self.n_w, self.box.softer
        terms = (self.basis(self.box(t)) @ self.coefficients).reshape(n_a + n_a * n_a, -1)
        i, j = self.pairs
        twice = np.where(i == j, 0.5, 1.0) * w[i] * w[j]
        value = terms[:, 0] / softer - terms[:, 1 : 1 + n_w] @ w - softer * terms[:, 1 + n_w :] @ twice
        by_C = softer * terms[:n_a, 1 + n_w :][:, self._unpack]  # (n_a, n_w, n_w)
        by_w = -terms[:n_a, 1 : 1 + n_w] - by_C @ w
        return value[:n_a], np.hstack([value[n_a:].reshape(n_a, n_a), by_w])


def potential_series(
    model: SpectralPredictor, loaded: np.ndarray
) -> tuple[np.ndarray, np.ndarray, list[tuple[int, int]]]:
    """Indices (M, n) and the series (1 + n_w + pairs, M) of Psi, of the loaded rows and of their C; the pairs of C."""
    energy = layout(model.rows.n_a, model.rows.n_e)["energy"]
    rows = [(model.arrays["indices"], model.arrays["series"][energy])]
    rows += [displacement_series(model, row) for row in loaded]
    pairs = [(i, j) for i in range(len(loaded)) for j in range(i, len(loaded))]
    rows += [compliance_series(model, int(loaded[i]), int(loaded[j])) for i, j in pairs]
    indices, series = joined(rows)
    return indices, series[:, 0], pairs


def displacement_series(model: SpectralPredictor, row: int) -> tuple[np.ndarray, np.ndarray]:
    """Indices (M, n) and the series (1, M) of one row."""
    n_e = model.rows.n_e
    if row < n_e:
        first = layout(model.rows.n_a, n_e)["effector"].start + row
        return model.arrays["indices"], model.arrays["series"][first : first + 1]
    return model.skin.arrays["indices"], model.skin.arrays["series"][row - n_e : row - n_e + 1]


def compliance_series(model: SpectralPredictor, i: int, j: int) -> tuple[np.ndarray, np.ndarray]:
    """Indices (M, n) and the series (1, M) of C between the rows i and j."""
    n_e, i, j = model.rows.n_e, min(i, j), max(i, j)
    if j < n_e:
        place = layout(model.rows.n_a, n_e)["effector_compliance"].start + int(unpacking(n_e)[i, j])
        return model.arrays["indices"], model.arrays["series"][place : place + 1]
    arrays, k = model.skin.arrays, len(model.skin)
    place = i * k + j - n_e if i < n_e else n_e * k + int(unpacking(k)[i - n_e, j - n_e])
    return arrays["compliance_indices"], arrays["compliance"][place : place + 1]
