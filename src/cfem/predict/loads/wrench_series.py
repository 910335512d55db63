"""One model under wrenches that differ from query to query: all that a loaded state needs, at one displacement.

With D = dC/dw and E = d2C/dw2 (symmetric in all indices) where the model has learned them, u = w . C w / 2,
v = D[w, w, w] / 6 and q = E[w, w, w, w] / 24,

    Psi_w = Psi - w . e - u h(r)        e_w = -d Psi_w / dw        h(r) = 1 / (1 - r) = 1 + r + r^2 + ...
    r = v / u, and with E: v / u + q / u - (v / u)^2

so that u h(r) = u + v + q to the order that is known, which is `cfem.predict.loads.loaded` to the second order in e,
with E to the third. All further orders are a guess by the Pade approximant along w (Baker and Graves-Morris, *Pade
Approximants*, 1996): exact where the load makes the body softer as it makes a column, u / (1 - w / w_c). Beyond
r = NEAR its pole, buckling, is too near to be believed; below r = STIFF displacements would end at a bound: h goes on
as a parabola, so that an iteration may pass there, and `Loaded.ratio` tells. Without D, r = 0.

The series of Psi, e, C and D and their first and second derivatives by delta_a are evaluated at once; a wrench then
only contracts them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cfem.condensed.packing import pack_upper, packed_indices, unpacking
from cfem.constraint.patch import PatchLoad
from cfem.predict.kinds.spectral import SpectralPredictor
from cfem.predict.loads.curvature import CurvatureSeries, HeldCurvature
from cfem.predict.loads.loaded_rows import rows_of
from cfem.predict.series.chebyshev import Basis
from cfem.predict.series.derivatives import input_derivatives
from cfem.predict.series.energy import FOURTH

NEAR = 0.5  # share of the load that would buckle, by the series: up to here it is believed
STIFF = -2.0  # where the load has taken all but 1 / 27 of the compliance
TINY = 1e-30  # N mm: what C w works less than is rounding


@dataclass(frozen=True)
class Loaded:
    """One state under a wrench, actuators held.

    lam: (n_a,) forces that hold the actuators
    K: (n_a, n_a) derivative of lam by delta_a
    e: (n_e,) displacements
    G: (n_e, n_a) derivative of e by delta_a
    C: (n_e, n_e) derivative of e by the wrench
    ratio: r"""

    lam: np.ndarray
    K: np.ndarray
    e: np.ndarray
    G: np.ndarray
    C: np.ndarray
    ratio: float = 0.0


class WrenchSeries:
    """Series of a model of form displacement, without parameters, for wrenches on the first `watched` of its effector
    rows and on patches of its skin, behind these. D and E do not know the patches; where there are fewer than `places`,
    rows follow that do not move."""

    def __init__(self, model: SpectralPredictor, watched: int, patches: Sequence[PatchLoad] = (), places: int = 0):
        """Joins the series of psi, e, C and D, and differentiates them twice by delta_a."""
        n_a, rows, size = model.rows.n_a, rows_of(model, patches), watched + 3 * places
        columns = np.r_[:watched, model.rows.n_e : rows.e.shape[1]]
        still = (0, size - len(columns))
        e, C = (
            np.pad(rows.e[:, columns], ((0, 0), still)),
            np.pad(rows.C[:, columns][:, :, columns], ((0, 0), still, still)),
        )
        parts = [rows.psi, e, pack_upper(C)]
        if rows.D is not None:
            D = np.pad(rows.D[:, columns][:, :, columns][:, :, :, columns], ((0, 0), still, still, still))
            parts.append(D[:, *packed_indices(size, 3)])
        parts = np.concatenate(parts, axis=1)  # (M, q)
        by_s = input_derivatives(rows.indices, model.arrays["to_box"], n_a)
        first = [D @ parts for D in by_s]
        second = [by_s[j] @ first[i] for i in range(n_a) for j in range(n_a)]
        self._n_a, self._n_e, self._box, self._basis = n_a, size, model.box, Basis(rows.indices)
        self._coefficients = np.concatenate([parts, *first, *second], axis=1)
        self._unpack = 1 + size + unpacking(size)
        first_of_D = 1 + size + size * (size + 1) // 2
        self._unpack3 = None if rows.D is None else first_of_D + unpacking(size, 3)

        self._curvature = CurvatureSeries(model, watched) if FOURTH in model.arrays and rows.D is not None else None

    def at(self, delta_a: np.ndarray) -> "Held":
        """Quantities at delta_a (n_a,) mm, for any wrench."""
        n = self._n_a
        flat = (self._basis(self._box(delta_a)) @ self._coefficients).reshape(1 + n + n * n, -1)
        D = None if self._unpack3 is None else flat[:, self._unpack3]
        E = None if self._curvature is None else self._curvature.at(delta_a)
        return Held(flat[:, 0], flat[:, 1 : 1 + self._n_e], flat[:, self._unpack], D, n, E)


@dataclass(frozen=True)
class Held:
    """Quantities at one delta_a: value, n first and n n second derivatives, in this order along the first axis."""

    psi: np.ndarray
    e: np.ndarray
    C: np.ndarray
    D: np.ndarray | None
    n_a: int
    E: HeldCurvature | None = None

    def under(self, w: np.ndarray) -> Loaded:
        """State under w (n_e,) N and N mm."""
        n, Cw = self.n_a, self.C @ w
        psi, e = self.psi - self.e @ w, self.e
        u = Cw @ w / 2
        if self.D is None or not u[0] > TINY:
            psi = psi - u
            return Loaded(psi[1 : 1 + n], psi[1 + n :].reshape(n, n), (e + Cw)[0], (e + Cw)[1 : 1 + n].T, self.C[0])
        Dw = self.D @ w
        orders, softer = [Cw, Dw @ w / 2], [self.C[0], Dw[0]]  # and their derivatives by w, at the value
        if self.E is not None:
            c, square, known = np.zeros_like(Cw), np.zeros_like(self.C[0]), self.E.watched
            c[:, :known], square[:known, :known] = self.E.cubic(w[:known]), self.E.square(w[:known])
            orders, softer = [*orders, c], [*softer, square]
        terms = [order @ w / (2 + number) for number, order in enumerate(orders)]  # u, v, q, and derivatives by delta_a
        r, f, F = continued(*(float(term[0]) for term in terms))
        both = np.stack(terms, axis=1)
        by_s, by_w = both[1 : 1 + n], np.stack([order[0] for order in orders])  # (n, 2 or 3), (2 or 3, n_e)
        psi = psi - both @ f
        moved = e + sum(share * order for share, order in zip(f, orders, strict=True))
        return Loaded(
            psi[1 : 1 + n],
            psi[1 + n :].reshape(n, n) - by_s @ F @ by_s.T,
            moved[0],
            moved[1 : 1 + n].T + by_w.T @ F @ by_s.T,
            sum(share * compliance for share, compliance in zip(f, softer, strict=True)) + by_w.T @ F @ by_w,
            r,
        )


def continued(u: float, v: float, q: float | None = None) -> tuple[float, np.ndarray, np.ndarray]:
    """The ratio r, and the first and second derivatives of u h(r) by u and v, and q where it is known."""
    r = v / u
    if q is None:
        slope, bend = np.array([-r, 1.0]) / u, np.array([[2 * r, -1.0], [-1.0, 0.0]]) / u**2
    else:
        s = q / u
        slope = np.array([2 * r * r - r - s, 1 - 2 * r, 1.0]) / u
        bend = np.array([[2 * (r + s) - 6 * r * r, 4 * r - 1, -1.0], [4 * r - 1, -2.0, 0.0], [-1.0, 0.0, 0.0]]) / u**2
        r += s - r * r
    h, h1, h2 = softening(r)
    by_u = np.eye(len(slope))[0]
    across = np.outer(by_u, slope)
    return r, h * by_u + u * h1 * slope, h1 * (across + across.T) + u * (h2 * np.outer(slope, slope) + h1 * bend)


def softening(r: float) -> tuple[float, float, float]:
    """The function h(r) and its first two derivatives."""
    near = min(max(r, STIFF), NEAR)
    s, more = 1.0 / (1.0 - near), r - near
    h, h1, h2 = s, s * s, 2.0 * s**3
    return h + more * (h1 + more * h2 / 2), h1 + more * h2, h2
