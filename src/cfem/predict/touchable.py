"""Where the surface of a learned robot may be touched, and how it yields there.

Patches p of the skin are where it may be touched. Their places follow from the modes u_k of the skin
(`cfem.predict.skin`) and from the forces f_p on them, which work on the modes by w_k = sum_p u_kp . f_p:

    x_p = X_p + sum_k u_kp s_k + sum_q R_p L_pq R_q^T f_q        s = s_0 + C_ss w        e = e_0 + C_es w

s_0, e_0 and the compliances C are the model's at delta_a. L_pq is what the modes leave of the compliance between two
patches. It is local: it falls with their distance and turns with them, by R_p, the rotation of a patch since rest that
fits its nodes best (Kabsch, 1976). Seen in the patches it changes little: a polynomial in delta_a of degree two, or of
one where that has many terms, through finite elements at as few states."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import qr

from cfem.condensed.patches import Patches, cut
from cfem.core.errors import InputError
from cfem.predict.chebyshev import basis
from cfem.predict.domain import Domain
from cfem.predict.protocol import Predictor

TERMS = 10  # of the polynomial through L: of degree two where that has no more
NONE = np.zeros(0)


@dataclass(frozen=True)
class Touchable:
    """A model with a skin, its patches, and their compliance `own` (J, 3 N, 3 N) mm/N, actuators held at `states`
    (J, n_a) mm, by finite elements (`cfem.equilibrium.patch_compliance`); `touch_states` says where."""

    model: Predictor
    patches: Patches
    states: np.ndarray
    own: np.ndarray

    def __post_init__(self) -> None:
        if self.model.form != "displacement" or self.model.parameters:
            raise InputError("contact anywhere needs a model of form displacement without parameters")
        J, n = len(self.states), 3 * len(self.patches)
        if self.own.shape != (J, n, n) or not np.isfinite(self.own).all():
            raise InputError(f"expected the finite compliance of {n // 3} patches at {J} states")

    @cached_property
    def U(self) -> np.ndarray:
        """(N, 3, k) the modes, means over patches."""
        return self.patches.mean(np.moveaxis(self.model.skin.modes, 0, -1))

    @cached_property
    def flat(self) -> np.ndarray:
        """(3 N, k) the same."""
        return self.U.reshape(-1, self.U.shape[-1])

    @cached_property
    def spread(self) -> tuple[np.ndarray, np.ndarray]:
        """(N, 3, 3) and (k, N, 3, 3): sum of (x - mean x) (X - mean X)^T over the nodes of each patch and of its
        triangles, at rest and by each row of the skin."""
        skin, of = self.model.skin, self.patches.of
        rest, by_row = np.zeros((len(self.patches), 3, 3)), np.zeros((len(skin), len(self.patches), 3, 3))
        corners = of[skin.triangles]
        for number in range(len(self.patches)):
            nodes = np.unique(skin.triangles[(corners == number).any(axis=1)])
            X = skin.rest[nodes] - skin.rest[nodes].mean(axis=0)
            rest[number] = X.T @ X
            by_row[:, number] = np.einsum("kia,ib->kab", skin.modes[:, nodes], X)
        return rest, by_row

    def turns(self, rows: np.ndarray, chosen: np.ndarray) -> np.ndarray:
        """(c, 3, 3) rotations of chosen patches since rest, rows (k,) mm of the skin."""
        rest, by_row = self.spread
        left, _, right = np.linalg.svd(rest[chosen] + np.tensordot(rows, by_row[:, chosen], axes=1))
        left[:, :, 2] *= np.sign(np.linalg.det(left @ right))[:, None]
        return left @ right

    @cached_property
    def degrees(self) -> np.ndarray:
        """Of the series of L."""
        return degrees(self.model.rows.n_a)[: len(self.states)]

    @cached_property
    def local(self) -> np.ndarray:
        """(terms, N, N, 3, 3) mm/N, series of L, rounded to single precision, as C has them: far below their error."""
        model, N = self.model, len(self.patches)
        left = np.empty((len(self.states), N, N, 3, 3))
        for j, (delta, own) in enumerate(zip(self.states, self.own, strict=True)):
            C = model.skin.compliance(delta, NONE)[1]
            apart = (own - self.flat @ C @ self.flat.T).reshape(N, 3, N, 3).swapaxes(1, 2)
            R = self.turns(model.skin.rows(delta, NONE), np.arange(N))
            left[j] = np.einsum("pba,pqbc,qcd->pqad", R, apart, R, optimize=True)
        at = basis(self._box(self.states), self.degrees)
        series = np.linalg.lstsq(at, left.reshape(len(left), -1), rcond=None)[0].reshape(-1, N, N, 3, 3)
        return ((series + series.transpose(0, 2, 1, 4, 3)) / 2).astype(np.float32).astype(float)

    def _box(self, delta: np.ndarray) -> np.ndarray:
        low, high = self.model.domain.delta_a
        return 2 * (delta - low) / (high - low) - 1

    def held(self, delta_a: np.ndarray) -> "Held":
        """The robot without forces on it, actuators held at delta_a (n_a,) mm."""
        skin = self.model.skin
        at = basis(self._box(delta_a), self.degrees)
        return Held(self, delta_a, skin.rows(delta_a, NONE), *skin.compliance(delta_a, NONE), at)


class Held:
    """The robot at one delta_a. rows (k,) mm of the skin and free (N, 3) mm places of the patches, without forces;
    C_es (n_e, k), C_ss (k, k) mm/N."""

    def __init__(
        self, of: Touchable, delta: np.ndarray, rows: np.ndarray, C_es: np.ndarray, C_ss: np.ndarray, at: np.ndarray
    ):
        self.of, self.delta, self.rows, self.C_es, self.C_ss, self._at = of, delta, rows, C_es, C_ss, at
        self.free = of.patches.rest + (of.flat @ rows).reshape(-1, 3)
        self._known: tuple[bytes, np.ndarray, np.ndarray] | None = None

    def work(self, chosen: np.ndarray, forces: np.ndarray) -> np.ndarray:
        """Patches (c,), (c, 3) N -> (k,) N: the load on the modes."""
        return forces.ravel() @ self.of.U[chosen].reshape(forces.size, len(self.rows))

    def places(self, chosen: np.ndarray, forces: np.ndarray) -> np.ndarray:
        """(N, 3) mm under forces (c, 3) N on chosen patches."""
        if not len(chosen):
            return self.free
        found = self.free + (self.of.flat @ (self.C_ss @ self.work(chosen, forces))).reshape(-1, 3)
        found[chosen] += (self._parts(chosen)[0] @ forces.ravel()).reshape(-1, 3)
        return found

    def compliance(self, chosen: np.ndarray) -> np.ndarray:
        """(3 c, 3 c) mm/N of the places of chosen patches, positive semidefinite."""
        return self._parts(chosen)[1]

    def _parts(self, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(3 c, 3 c) mm/N what the modes leave, and all."""
        key = chosen.tobytes()
        if self._known is None or self._known[0] != key:
            n, U = 3 * len(chosen), self.of.U[chosen].reshape(3 * len(chosen), -1)
            smooth, local = U @ self.C_ss @ U.T, self._local(chosen, n)
            try:
                np.linalg.cholesky(smooth + local)
            except np.linalg.LinAlgError:
                sizes, axes = np.linalg.eigh(smooth + local)
                local = (axes * np.maximum(sizes, 0.0)) @ axes.T - smooth
            self._known = key, local, smooth + local
        return self._known[1], self._known[2]

    def _local(self, chosen: np.ndarray, n: int) -> np.ndarray:
        R = self.of.turns(self.rows, chosen)
        L = np.tensordot(self._at, self.of.local[:, chosen[:, None], chosen], axes=1)
        turned = (R[:, None] @ L @ R[None].swapaxes(-1, -2)).swapaxes(1, 2).reshape(n, n)
        return (turned + turned.T) / 2


def degrees(n_a: int) -> np.ndarray:
    """(terms, n_a) degrees of the polynomial through L, the lower ones first."""
    one = np.eye(n_a, dtype=np.int64)
    two = [one[i] + one[j] for i in range(n_a) for j in range(i, n_a)]
    found = np.array([0 * one[0], *one, *two])
    return found if len(found) <= TERMS else found[: 1 + n_a]


def touch_states(domain: Domain, n_a: int) -> np.ndarray:
    """(J, n_a) mm: of the training states those at which finite elements say most of a polynomial in delta_a (pivots of
    a QR factorisation: Sommariva and Vianello, *Computing approximate Fekete points*, 2009)."""
    states = domain.states[:, :n_a]
    low, high = domain.delta_a
    at = basis(2 * (states - low) / (high - low) - 1, degrees(n_a))
    chosen = qr(at.T, mode="r", pivoting=True)[1][: min(at.shape)]
    return states[np.sort(chosen)]


def patches_of(model: Predictor, apart: float | None = None) -> Patches:
    """The patches of a model's skin, about `apart` mm from each other, a twentieth of the length unless given."""
    return cut(model.skin.rest, model.skin.weights, apart or model.length / 20)
