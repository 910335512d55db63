"""A condensed model that moves: the energy model with learned mass, viscosity and inner coordinates.

q = (delta_a, xi, zeta): the actuators' displacements; how far the watched rows are from their quasi-static place for
delta_a; amplitudes of motions that leave all rows alone. The effectors are at e(delta_a) + xi_e, and

    U = Psi(delta_a) + xi . C^-1 xi / 2 + zeta . K zeta / 2        T = dq/dt . M dq/dt / 2

C, M, K and the loss forms F of each viscous material are functions of delta_a. They are learned in the coordinates
eta of forces on the rows, xi = C eta + H zeta, in which all entries are smooth and small where the robot is stiff. They
are made positive over the states that the model has learned from. What is left out: how the motions of xi and zeta turn
as delta_a moves, in T."""

from dataclasses import dataclass
from itertools import accumulate, pairwise
from typing import Any

import numpy as np
from scipy.sparse import hstack

from cfem.core.errors import InputError
from cfem.core.reading import take
from cfem.predict.chebyshev import Basis
from cfem.predict.energy import unpacking
from cfem.predict.series import input_derivatives


@dataclass(frozen=True)
class Loss:
    """Of a viscous material: relaxation s, prony: (share, s) of each term."""

    relaxation: float
    prony: tuple[tuple[float, float], ...]

    def modulus(self, omega: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What F is multiplied by under vibration at omega, rad/s: storage, and loss."""
        stored, lost = np.zeros_like(omega), self.relaxation * omega
        for share, tau in self.prony:
            stored = stored + share * (omega * tau) ** 2 / (1 + (omega * tau) ** 2)
            lost = lost + share * omega * tau / (1 + (omega * tau) ** 2)
        return stored, lost


@dataclass(frozen=True)
class Place:
    """All at one delta_a. pull (n_a,): grad Psi; stiff (n_a, n_a): its Hessian; e (n_e,) mm; J (n_e, n_a);
    M (n_q, n_q); inner (n_r, n_r): stiffness of xi and zeta; F (k, n_q, n_q); dM (n_a, n_q, n_q), d_inner
    (n_a, n_r, n_r): derivatives by delta_a."""

    pull: np.ndarray
    stiff: np.ndarray
    e: np.ndarray
    J: np.ndarray
    M: np.ndarray
    inner: np.ndarray
    F: np.ndarray
    dM: np.ndarray
    d_inner: np.ndarray

    @property
    def K(self) -> np.ndarray:
        """(n_q, n_q): stiffness about a state of rest."""
        n_a, n = len(self.pull), len(self.M)
        out = np.zeros((n, n))
        out[:n_a, :n_a], out[n_a:, n_a:] = self.stiff, self.inner
        return out

    @property
    def effectors_by_q(self) -> np.ndarray:
        """(n_e, n_q)."""
        out = np.zeros((len(self.e), len(self.M)))
        n_a = self.J.shape[1]
        out[:, :n_a] = self.J
        out[:, n_a : n_a + len(out)] = np.eye(len(out))
        return out


class MotionModel:
    """static: the energy model (cfem.predict.potential.PotentialPredictor) of form displacement; arrays: of motion.npz:
    to_box (n_a, n_a), offset (n_a,), indices (M, n_a), series (n_out, M) in the order of `layout`, scale (n_q,) of q,
    in whose shares all is learned, watched: the number of rows that xi is of; viscosity: of each viscous material."""

    def __init__(self, static: Any, arrays: dict[str, np.ndarray], viscosity: list[dict[str, Any]]):
        if static.form != "displacement" or static.parameters or not hasattr(static, "parts"):
            raise InputError(
                "only energy models of form displacement without parameters can move", do="train kind: spectral"
            )
        self.static, self.rows = static, static.rows
        self.losses = tuple(Loss(one["relaxation"], tuple(map(tuple, one["prony"]))) for one in viscosity)
        n_a = self.rows.n_a
        self.n_a, self.n_q = n_a, len(take(arrays, "scale", (None,)))
        self.n_r, self.n_w = self.n_q - n_a, int(take(arrays, "watched", (), "iu"))
        indices = take(arrays, "indices", (None, n_a), "iu")
        self._layout = layout(self.n_q, self.n_r, len(self.losses))
        self._to_box_T = np.ascontiguousarray(take(arrays, "to_box", (n_a, n_a)).T)
        self._offset = take(arrays, "offset", (n_a,))
        outputs = next(reversed(self._layout.values())).stop
        self._series_T = np.ascontiguousarray(take(arrays, "series", (outputs, len(indices))).T)
        self._basis = Basis(indices)
        self._slopes = hstack(input_derivatives(indices, self._to_box_T.T, n_a), format="csc").T.tocsr()
        self.scale = take(arrays, "scale", (self.n_q,))
        self._size = np.outer(self.scale, self.scale)
        self._unpack_q, self._unpack_r = unpacking(self.n_q), unpacking(self.n_r)

    @property
    def rest_e(self) -> np.ndarray:
        """(n_e,) mm at rest."""
        return self.static.rest_e

    def at(self, delta_a: np.ndarray) -> Place:
        """Everything at delta_a (n_a,) mm."""
        part = self.static.parts(delta_a, delta_a[:0])
        phi = self._basis(delta_a @ self._to_box_T + self._offset)
        n_a, terms, where = self.n_a, len(phi), self._layout
        rows = np.empty((1 + n_a, terms))
        rows[0], rows[1:] = phi, (self._slopes @ phi).reshape(n_a, terms)
        smooth = where["K"].stop
        out = rows @ self._series_T[:, :smooth]
        M = out[:, where["M"]][:, self._unpack_q] / self._size
        inner = out[:, where["K"]][:, self._unpack_r] / self._size[n_a:, n_a:]
        F = np.zeros((len(self.losses), self.n_q, self.n_q))
        for index in range(len(self.losses)):
            F[index] = (phi @ self._series_T[:, where[f"F{index}"]])[self._unpack_q] / self._size
        G, dG = self._to_forces(inner)
        inner, d_inner = _turned(inner, G[n_a:, n_a:], dG[:, n_a:, n_a:])
        M, dM = _turned(M, G, dG)
        e, J = part["effector"], part["effector_gradient"]
        return Place(part["gradient"], part["hessian"], e, J, M, inner, G.T @ F @ G, dM, d_inner)

    def _to_forces(self, inner: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(n_q, n_q) eta by xi: eta = C^-1 (xi - H zeta), and its derivatives (n_a, n_q, n_q); inner (1 + n_a, n_r,
        n_r): C and H and their derivatives, in the coordinates of forces."""
        n_a, r = self.n_a, slice(self.n_a, self.n_a + self.n_w)
        C, H = inner[:, : self.n_w, : self.n_w], inner[:, : self.n_w, self.n_w :]
        inverse = np.linalg.inv(C[0])
        G, dG = np.eye(self.n_q), np.zeros((n_a, self.n_q, self.n_q))
        G[r, r], G[r, r.stop :] = inverse, -inverse @ H[0]
        d_inverse = -inverse @ C[1:] @ inverse
        dG[:, r, r], dG[:, r, r.stop :] = d_inverse, -d_inverse @ H[0] - inverse @ H[1:]
        return G, dG


def _turned(matrix: np.ndarray, G: np.ndarray, dG: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """G^T A G and its derivatives, of A and its derivatives (1 + n_a, n, n)."""
    half = matrix[0] @ G
    mixed = dG.swapaxes(1, 2) @ half
    return G.T @ half, G.T @ matrix[1:] @ G + mixed + mixed.swapaxes(1, 2)


def layout(n_q: int, n_r: int, losses: int) -> dict[str, slice]:
    """Where the outputs of the series hold each part, in shares of the scale of q: M and K of the inner coordinates, C
    and H its first rows, and each loss form, as their upper triangles."""
    sizes = {"M": n_q * (n_q + 1) // 2, "K": n_r * (n_r + 1) // 2}
    sizes |= {f"F{index}": n_q * (n_q + 1) // 2 for index in range(losses)}
    ends = [0, *accumulate(sizes.values())]
    return {name: slice(*pair) for name, pair in zip(sizes, pairwise(ends), strict=True)}
