"""One model under wrenches that differ from query to query: all that a loaded state needs, at one displacement.

With D = dC/dw (symmetric in all three indices) where the model has learned it,

    Psi_w = Psi - w . e - w . C w / 2 - D[w, w, w] / 6        e_w = -d Psi_w / dw = e + C w + D[w, w] / 2

(see `cfem.predict.loaded`). The series of Psi, e, C and D and their first and second derivatives by delta_a are
evaluated at once; a wrench then only contracts them."""

from dataclasses import dataclass

import numpy as np

from cfem.predict.energy import THIRD, layout, unpacking, unpacking3
from cfem.predict.series import input_derivatives
from cfem.predict.spectral import SpectralPredictor


@dataclass(frozen=True)
class Loaded:
    """One state under a wrench, actuators held. lam (n_a,): the forces that hold them; K (n_a, n_a) their derivative;
    e (n_e,) displacements, G (n_e, n_a) by delta_a, C (n_e, n_e) by the wrench."""

    lam: np.ndarray
    K: np.ndarray
    e: np.ndarray
    G: np.ndarray
    C: np.ndarray


class WrenchSeries:
    """Of a model of form displacement, without parameters, for wrenches on the first `watched` of its effector rows."""

    def __init__(self, model: SpectralPredictor, watched: int):
        n_a, n_e = model.rows.n_a, model.rows.n_e
        rows, series = layout(n_a, n_e), model.arrays["series"]
        parts = [series[rows[name]] for name in ("energy", "effector", "effector_compliance")]
        if THIRD in model.arrays:
            parts.append(model.arrays[THIRD])
        parts = np.concatenate(parts).T  # (M, q)
        by_s = input_derivatives(model.arrays["indices"], model.arrays["to_box"], n_a)
        first = [D @ parts for D in by_s]
        second = [by_s[j] @ first[i] for i in range(n_a) for j in range(n_a)]
        self._n_a, self._n_e, self._model = n_a, watched, model
        self._coefficients = np.concatenate([parts, *first, *second], axis=1)
        own, third = slice(0, watched), 1 + n_e + n_e * (n_e + 1) // 2
        self._unpack = 1 + n_e + unpacking(n_e)[own, own]
        self._unpack3 = third + unpacking3(n_e)[own, own, own] if THIRD in model.arrays else None

    def at(self, delta_a: np.ndarray) -> "Held":
        """delta_a: (n_a,) mm."""
        n = self._n_a
        flat = (self._model.basis(delta_a) @ self._coefficients).reshape(1 + n + n * n, -1)
        D = None if self._unpack3 is None else flat[:, self._unpack3]
        return Held(flat[:, 0], flat[:, 1 : 1 + self._n_e], flat[:, self._unpack], D, n)


@dataclass(frozen=True)
class Held:
    """The quantities at one delta_a: value, n first and n n second derivatives, in this order along the first axis."""

    psi: np.ndarray
    e: np.ndarray
    C: np.ndarray
    D: np.ndarray | None
    n_a: int

    def under(self, w: np.ndarray) -> Loaded:
        """w: (n_e,) N and N mm."""
        n, Cw = self.n_a, self.C @ w
        psi, e, C = self.psi - self.e @ w - Cw @ w / 2, self.e + Cw, self.C[0]
        if self.D is not None:
            Dw = self.D @ w
            psi, e, C = psi - Dw @ w @ w / 6, e + Dw @ w / 2, C + Dw[0]
        return Loaded(psi[1 : 1 + n], psi[1 + n :].reshape(n, n), e[0], e[1 : 1 + n].T, C)
