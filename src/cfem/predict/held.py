"""A touchable robot with its actuators held, under forces on patches of its surface (`cfem.predict.touchable`).

How its rows go is known to the second order in the load w on the modes of the skin:

    rows = rows_0 + C_ss w + D_ss[w, w] / 2 + ...

and the orders beyond follow as far as the energy along the load tells them (`cfem.predict.beyond`). So do the dents, by
which a force on a patch changes what this patch yields. All of it is the derivative of one energy by the forces, so
that the compliance is symmetric."""

from dataclasses import dataclass

import numpy as np

from cfem.predict.beyond import Beyond, beyond
from cfem.predict.chebyshev import basis
from cfem.predict.touchable import NONE, Touchable, turn_cubic


class Held:
    """The robot at one delta_a (n_a,) mm. unloaded (k,) mm: rows of the skin without forces, free (N, 3) mm: places of
    the patches then; C_es (n_e, k) and C_ss (k, k) mm/N.

    chosen (c,), forces (c, 3) N: patches and what is on them since `bear`, none at first; w (k,) N: their load on the
    modes; rows (k,) mm under it."""

    def __init__(self, of: Touchable, delta: np.ndarray):
        skin, k = of.model.skin, len(of.model.skin)
        self.of, self.delta, self.unloaded = of, delta, skin.rows(delta, NONE)
        self.C_es, self.C_ss = skin.compliance(delta, NONE)
        self._at = basis(of.in_box(delta), of.degrees)
        self._D = (self._at @ of.bent_flat).reshape(k, -1)
        self.free = of.patches.rest + (of.flat @ self.unloaded).reshape(-1, 3)
        self._known: tuple[bytes, _Parts] | None = None
        self.chosen, self.forces = np.zeros(0, dtype=np.int64), np.zeros((0, 3))
        self.w, self.rows = np.zeros(k), self.unloaded

    def bear(self, chosen: np.ndarray, forces: np.ndarray) -> None:
        """Puts forces (c, 3) N on patches (c,), and takes all others off."""
        self.chosen, self.forces = chosen, forces
        n_e, k = self.C_es.shape
        if not len(chosen):
            self.w, self.rows = np.zeros(k), self.unloaded
            return
        parts = self._parts(chosen)
        self.w = w = forces.ravel() @ parts.U
        self._change = (w @ self._D).reshape(n_e + k, k)  # of C_es and C_ss
        self._by_modes: Beyond = beyond(w, self.C_ss @ w, self._change[n_e:] @ w)
        self.rows = self.unloaded + self._by_modes.motion
        first = parts.yields[:, None] * forces
        self._dents = (parts.dented[..., :3] @ forces[:, None, :, None])[..., 0]  # of the patches' own compliance
        self._by_dents: Beyond = beyond(forces, first, (self._dents @ forces[:, :, None])[..., 0])
        self._beyond_own = self._by_dents.motion - first

    def places(self) -> np.ndarray:
        """(N, 3) mm of all patches. What is local is known of the chosen ones alone."""
        if not len(self.chosen):
            return self.free
        found = self.free + (self.of.flat @ (self.rows - self.unloaded)).reshape(-1, 3)
        found[self.chosen] += (self._parts(self.chosen).left @ self.forces.ravel()).reshape(-1, 3)
        found[self.chosen] += self._beyond_own
        return found

    def compliance(self) -> np.ndarray:
        """(3 c, 3 c) mm/N: derivative of the chosen patches' places by the forces on them, symmetric."""
        parts, c, n_e = self._parts(self.chosen), len(self.chosen), len(self.C_es)
        if not self.w.any():
            return parts.total
        change = self._by_modes.slope(self.C_ss, self._change[n_e:]) - self.C_ss
        found, each = parts.total + parts.U @ change @ parts.U.T, np.arange(c)
        first = parts.yields[:, None, None] * np.eye(3)
        found.reshape(c, 3, c, 3)[each, :, each] += self._by_dents.slope(first, self._dents) - first
        return found

    def unpressed(self, chosen: np.ndarray) -> np.ndarray:
        """(3 c, 3 c) mm/N: the same of any patches without forces, symmetric and positive semidefinite."""
        return self._parts(chosen).total

    def tip(self) -> np.ndarray:
        """(n_e,) mm that the effectors are moved by the forces."""
        n_e = len(self.C_es)
        if not len(self.chosen):
            return np.zeros(n_e)
        parts, more, dents = self._parts(self.chosen), self._by_modes, self._by_dents
        series = self.of.local_tip[:, :, self.chosen].reshape(len(self._at), -1)
        local = (self._at @ series).reshape(n_e, -1, 1, 3) @ parts.R.swapaxes(1, 2)
        own = (local[:, :, 0] * self.forces).sum(axis=2)
        dented = np.einsum("pabe,pa,pb->ep", parts.dented[..., 3:], self.forces, self.forces)
        found = (more.first * self.C_es + more.second / 2 * self._change[:n_e]) @ self.w
        return found + (own + dents.second / 2 * dented).sum(axis=1)

    def relief(self) -> np.ndarray:
        """(n_a,) N by which the forces help the actuators to stay."""
        skin, w, terms = self.of.model.skin, self.w, len(self._at)
        if not len(self.chosen):
            return np.zeros(len(self.delta))
        more = self._by_modes
        found = w @ skin.gradient(self.delta, NONE) + more.first * skin.compliance_work(self.delta, NONE, w) / 2
        third = self.of.bent_slopes.reshape(-1, len(w) ** 2, len(w)) @ w @ np.outer(w, w).ravel()
        return found + more.second / 6 * (third.reshape(-1, terms) @ self._at)

    def _parts(self, chosen: np.ndarray) -> "_Parts":
        key = chosen.tobytes()
        if self._known is None or self._known[0] != key:
            c, U = len(chosen), self.of.U[chosen].reshape(3 * len(chosen), len(self.C_ss))
            R, each = self.of.turns(self.unloaded, chosen), np.arange(c)
            smooth, left = U @ self.C_ss @ U.T, self._local(chosen, R)
            try:
                np.linalg.cholesky(smooth + left)
            except np.linalg.LinAlgError:
                sizes, axes = np.linalg.eigh(smooth + left)
                left = (axes * np.maximum(sizes, 0.0)) @ axes.T - smooth
            total, terms = smooth + left, len(self._at)
            dented = turn_cubic((self._at @ self.of.dented[:, chosen].reshape(terms, -1)).reshape(c, 3, 3, -1), R)
            yields = stiff(total.reshape(c, 3, c, 3)[each, :, each])
            self._known = key, _Parts(U, left, total, yields, R, dented)
        return self._known[1]

    def _local(self, chosen: np.ndarray, R: np.ndarray) -> np.ndarray:
        c, terms = len(chosen), len(self._at)
        pairs = self.of.local[:, chosen[:, None], chosen].reshape(terms, -1)
        turned = (R[:, None] @ (self._at @ pairs).reshape(c, c, 3, 3) @ R[None].swapaxes(-1, -2)).swapaxes(1, 2)
        turned = turned.reshape(3 * c, 3 * c)
        return (turned + turned.T) / 2


@dataclass(frozen=True)
class _Parts:
    """Of c chosen patches without forces: U (3 c, k) their modes, left (3 c, 3 c) mm/N what these leave of the
    compliance, total (3 c, 3 c) all of it, yields (c,) mm/N each one where it is stiff, R (c, 3, 3) rotations since
    rest, dented (c, 3, 3, 3) mm/N^2 their E in the robot's axes."""

    U: np.ndarray
    left: np.ndarray
    total: np.ndarray
    yields: np.ndarray
    R: np.ndarray
    dented: np.ndarray


def stiff(own: np.ndarray) -> np.ndarray:
    """(c,) harmonic means of the eigenvalues of own (c, 3, 3), near those of what is local: a soft body yields in one
    or two directions, and is dented in all."""
    minors = sum(own[:, i, i] * own[:, j, j] - own[:, i, j] ** 2 for i, j in ((0, 1), (0, 2), (1, 2)))
    return 3 * np.linalg.det(own) / minors
