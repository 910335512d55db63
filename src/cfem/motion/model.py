"""A condensed model that moves: the energy model with learned mass, viscosity and inner motions.

q = (delta_a, eta): the actuators' displacements, and amplitudes of motions that leave the actuators alone, scaled so
that all of them are alike stiff. The effectors are at e(delta_a) + H eta + E[eta, eta] / 2, and

    U = Psi(delta_a) + kappa eta . eta / 2        T = dq/dt . M dq/dt / 2

(constraint modes and inner motions as of Craig and Bampton, AIAA J. 6, 1968, at every state instead of one). E, which
makes arcs of the effectors' paths, is known where the samples had `loads: true`; otherwise it counts as 0. H, E, the
mass M and the loss forms F of each viscous material are functions of delta_a. M and F are squares of symmetric learned
matrices: they are positive at every state by construction. What is left out: how the inner motions turn as delta_a
moves, in T; and what stiffer inner motions would add to the effectors' compliance."""

from dataclasses import dataclass
from itertools import accumulate, pairwise
from typing import Any, Protocol, runtime_checkable

import numpy as np
from scipy.sparse import hstack

from cfem.condensed.packing import unpacking
from cfem.condensed.viscosity import Viscosity
from cfem.core.errors import InputError
from cfem.core.reading import take
from cfem.motion.inner_skin import InnerSkin
from cfem.predict.series.chebyshev import Basis
from cfem.predict.series.derivatives import input_derivatives


@runtime_checkable
class HasParts(Protocol):
    """A model of an energy, whose parts can be asked."""

    def parts(self, s: np.ndarray, q: np.ndarray) -> dict[str, np.ndarray]:
        """The potential, its derivatives and what is beside them at s (..., n_a): see
        `cfem.predict.series.energy.layout`."""
        ...


@dataclass(frozen=True)
class MotionTerms:
    """Terms of the equations of motion at one delta_a.

    pull, stiff: (n_a,) and (n_a, n_a), grad Psi and its Hessian
    e, J: (n_e,) mm and (n_e, n_a), effectors and their slope
    M, dM: (n_q, n_q) mass and (n_a, n_q, n_q), its derivatives by delta_a
    inner: (n_r, n_r) stiffness of eta, the same everywhere
    F: (k, n_q, n_q) loss forms
    H, dH: (n_e, n_r) motion of the effectors by eta, and (n_a, n_e, n_r)
    E, dE: (n_e, n_r, n_r) slope of H by eta, and (n_a, n_e, n_r, n_r), None where they are not known"""

    pull: np.ndarray
    stiff: np.ndarray
    e: np.ndarray
    J: np.ndarray
    M: np.ndarray
    inner: np.ndarray
    F: np.ndarray
    dM: np.ndarray
    H: np.ndarray
    dH: np.ndarray
    E: np.ndarray | None = None
    dE: np.ndarray | None = None

    @property
    def K(self) -> np.ndarray:
        """Stiffness (..., n_q, n_q) about a state of rest."""
        n_a, out = self.stiff.shape[-1], np.zeros(self.M.shape)
        out[..., :n_a, :n_a], out[..., n_a:, n_a:] = self.stiff, self.inner
        return out

    @property
    def effectors_by_q(self) -> np.ndarray:
        """Slopes (n_e, n_q) of the effectors by q where there are no inner motions."""
        return np.concatenate([self.J, self.H], axis=1)

    def effectors(self, eta: np.ndarray) -> np.ndarray:
        """Displacements (n_e,) mm of the effectors, with inner motions eta (n_r,)."""
        straight = self.e + self.H @ eta
        return straight if self.E is None else straight + self.E @ eta @ eta / 2

    def slopes(self, eta: np.ndarray) -> np.ndarray:
        """Slopes (n_e, n_q) of `effectors` by q."""
        by_turn, by_eta = (self.dH @ eta).T, self.H
        if self.E is not None:
            by_turn, by_eta = by_turn + (self.dE @ eta @ eta).T / 2, by_eta + self.E @ eta
        return np.concatenate([self.J + by_turn, by_eta], axis=1)


class MotionModel:
    """A learned robot that moves: mass, viscosity and inner motions beside a model at rest.

    static: the energy model (cfem.predict.kinds.spectral.SpectralPredictor) of form displacement
    arrays: of motion.npz: to_box (n_a, n_a), offset (n_a,), indices (M, n_a); series (n_out, M) in the order of
        `layout`; scale (n_q,), the unit of each of q in which M and F are learned; stiffness: kappa, N mm; curve (n_e
        n_r (n_r + 1) / 2, M): series of E, or none; what `InnerSkin` takes, or none
    viscosity: that each loss form is multiplied by
    skin: how the inner motions move effectors and skin, None where that was not learned"""

    def __init__(self, static: Any, arrays: dict[str, np.ndarray], viscosity: list[dict[str, Any]]):
        """Reads the series of motion of a static model. InputError where the model is of another kind."""
        if static.form != "displacement" or static.parameters or not isinstance(static, HasParts):
            raise InputError(
                "only energy models of form displacement without parameters can move", do="train kind: spectral"
            )
        self.static, self.rows, self.arrays = static, static.rows, arrays
        self.losses = tuple(Viscosity(loss["relaxation"], tuple(map(tuple, loss["prony"]))) for loss in viscosity)
        n_a, n_e = self.rows.n_a, self.rows.n_e
        self.scale = take(arrays, "scale", (None,))
        self.n_a, self.n_q = n_a, len(self.scale)
        self.n_r, self.stiffness = self.n_q - n_a, float(take(arrays, "stiffness", ()))
        indices = take(arrays, "indices", (None, n_a), "iu")
        where = layout(self.n_q, self.n_r, n_e, len(self.losses))
        to_box = take(arrays, "to_box", (n_a, n_a))
        self._to_box_T, self._offset = np.ascontiguousarray(to_box.T), take(arrays, "offset", (n_a,))
        series = take(arrays, "series", (next(reversed(where.values())).stop, len(indices)))
        self._basis = Basis(indices)
        of_loss = series[where["H"].stop :]
        self._lossy = np.flatnonzero(of_loss.any(axis=0))
        parts = (series[where["M"]], series[where["H"]], of_loss[:, self._lossy])
        self._M_T, self._H_T, self._F_T = (np.ascontiguousarray(part.T) for part in parts)
        self._curve_T, self._unpack_r = None, unpacking(self.n_r)
        if "curve" in arrays:
            outputs = n_e * self.n_r * (self.n_r + 1) // 2
            self._curve_T = np.ascontiguousarray(take(arrays, "curve", (outputs, len(indices))).T)
        self.skin = InnerSkin(arrays, parts[1], self.n_r) if "skin" in arrays else None
        self._slopes = hstack(input_derivatives(indices, to_box, n_a), format="csc").T.tocsr()
        self._unpack = unpacking(self.n_q)
        self.inner = self.stiffness * np.eye(self.n_r)
        self.inner.flags.writeable = False

    @property
    def rest_e(self) -> np.ndarray:
        """Positions (n_e,) mm of the effectors at rest."""
        return self.static.rest_e

    def at(self, delta_a: np.ndarray) -> MotionTerms:
        """Everything at delta_a (n_a,) mm."""
        part = self.static.parts(delta_a, delta_a[:0])
        return MotionTerms(
            pull=part["gradient"],
            stiff=part["hessian"],
            e=part["effector"],
            J=part["effector_gradient"],
            inner=self.inner,
            **self.learned(delta_a),
        )

    def learned(self, delta_a: np.ndarray, slopes: bool = True) -> dict[str, np.ndarray]:
        """Learned terms M, F, H and, where it is known, E of `MotionTerms` at delta_a (n_a,) mm, and their slopes where
        these are asked."""
        terms = self._terms(delta_a, slopes)
        M, dM, F = self._inertia(terms)
        H, E = self._bends(terms)
        terms_at = {"M": M, "F": F, "H": H[0]} | ({"dM": dM, "dH": H[1:]} if slopes else {})
        if E is None:
            return terms_at
        return terms_at | {"E": E[0]} | ({"dE": E[1:]} if slopes else {})

    def paths(self, delta_a: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
        """H and E of `MotionTerms` at delta_a (n_a,) mm."""
        H, E = self._bends(self._terms(delta_a, slopes=False))
        return H[0], None if E is None else E[0]

    def _bends(self, terms: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
        n, n_e = len(terms), self.rows.n_e
        H = (terms @ self._H_T).reshape(n, n_e, self.n_r)
        if self._curve_T is None:
            return H, None
        return H, (terms @ self._curve_T).reshape(n, n_e, -1)[:, :, self._unpack_r]

    def forces(self, delta_a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Forces (n_a,) and their slopes (n_a, n_a), grad Psi and its Hessian at delta_a (n_a,) mm."""
        return self.static.gradient_and_hessian(delta_a)

    def inertia(self, delta_a: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """M, dM and F of `MotionTerms` at delta_a (n_a,) mm."""
        return self._inertia(self._terms(delta_a))

    def half_widths(self, change: np.ndarray) -> float:
        """A change (n_a,) mm of delta_a in half widths of the box that was learned."""
        return float(np.abs(change @ self._to_box_T).max())

    def _terms(self, delta_a: np.ndarray, slopes: bool = True) -> np.ndarray:
        """Basis and its derivatives by delta_a (1 + n_a, M); (1, M) without `slopes`."""
        phi = self._basis(delta_a @ self._to_box_T + self._offset)
        if not slopes:
            return phi[None]
        terms = np.empty((1 + self.n_a, len(phi)))
        terms[0], terms[1:] = phi, (self._slopes @ phi).reshape(self.n_a, -1)
        return terms

    def _inertia(self, terms: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Mass M, its derivatives dM, and loss forms F from the terms of the series."""
        n = self.n_q
        roots = (terms @ self._M_T).take(self._unpack, axis=1)
        roots /= self.scale
        # the derivatives of a symmetric root D^-1 times the root: one product for all
        half = roots[1:].transpose(0, 2, 1).reshape(-1, n) @ roots[0]
        half = half.reshape(-1, n, n)
        triangles = (terms[0, self._lossy] @ self._F_T).reshape(len(self.losses), self._M_T.shape[1])
        losses = triangles.take(self._unpack, axis=1) / self.scale
        return roots[0].T @ roots[0], half + half.swapaxes(1, 2), losses.swapaxes(1, 2) @ losses


def layout(n_q: int, n_r: int, n_e: int, losses: int) -> dict[str, slice]:
    """Slices of the outputs of the series: the upper triangle of the root of M, H row by row, and the upper triangle of
    the root of each loss form."""
    triangle = n_q * (n_q + 1) // 2
    sizes = {"M": triangle, "H": n_e * n_r} | {f"F{index}": triangle for index in range(losses)}
    ends = [0, *accumulate(sizes.values())]
    return {name: slice(*pair) for name, pair in zip(sizes, pairwise(ends), strict=True)}
