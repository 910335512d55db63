"""A touchable robot with its actuators held, under forces on patches of its surface (`cfem.predict.touchable`).

How its rows go is known to the second order in the load w on the modes of the skin:

    rows = rows_0 + C_ss w + share D_ss[w, w] / 2

The second order is not trusted beyond TRUSTED of the first: `share` is 1, or less where that would be passed. So are
the dents, share_p E_p[f_p, f_p] / 2 of each patch, which may change its own compliance by 2 TRUSTED (Frobenius norm of
the change relative to it). Shares follow from the forces, so that places are functions of these, with derivatives."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cfem.predict.chebyshev import basis
from cfem.predict.touchable import NONE, Touchable, turn_cubic

LEVEL = 1e-14  # of the largest own compliance, where a patch is held and has none
TRUSTED = 0.3  # largest share of the motion by forces that is of second order


class Held:
    """The robot at one delta_a (n_a,) mm. unloaded (k,) mm: rows of the skin without forces, free (N, 3) mm: places of
    the patches then; C_es (n_e, k) and C_ss (k, k) mm/N.

    chosen (c,), forces (c, 3) N: patches and what is on them since `bear`, none at first; w (k,) N: their load on the
    modes; rows (k,) mm under it; share, dent_share (c,): of the second orders that are taken."""

    def __init__(self, of: Touchable, delta: np.ndarray):
        skin, k = of.model.skin, len(of.model.skin)
        self.of, self.delta, self.unloaded = of, delta, skin.rows(delta, NONE)
        self.C_es, self.C_ss = skin.compliance(delta, NONE)
        self._at = basis(of.in_box(delta), of.degrees)
        self._D = (self._at @ of.bent_flat).reshape(k, -1)
        self.free = of.patches.rest + (of.flat @ self.unloaded).reshape(-1, 3)
        self._known: tuple[bytes, _Parts] | None = None
        self.bear(np.zeros(0, dtype=np.int64), np.zeros((0, 3)))

    def bear(self, chosen: np.ndarray, forces: np.ndarray) -> None:
        """Puts forces (c, 3) N on patches (c,), and takes all others off."""
        self.chosen, self.forces = chosen, forces
        n_e, k = self.C_es.shape
        parts = self._parts(chosen)
        self.w = w = forces.ravel() @ parts.U
        change = (w @ self._D).reshape(n_e + k, k)
        self._first, self._more = self.C_ss @ w, change[n_e:] @ w
        largest, more = 2 * TRUSTED * _size(self._first), _size(self._more)
        self.share = largest / more if more > largest else 1.0
        self._change = self.share * change  # of C_es and C_ss
        self.rows = self.unloaded + self._first + self.share / 2 * self._more
        on = forces[:, None, :, None]
        self._excess = (parts.relative @ on)[..., 0]
        size = np.sqrt((self._excess**2).sum(axis=(1, 2)))
        self.dent_share = 2 * TRUSTED / np.maximum(size, 2 * TRUSTED)
        self._dents = self.dent_share[:, None, None] * (parts.dented @ on)[..., 0]

    def places(self) -> np.ndarray:
        """(N, 3) mm of all patches. What is local is known of the chosen ones alone."""
        if not len(self.chosen):
            return self.free
        found = self.free + (self.of.flat @ (self.rows - self.unloaded)).reshape(-1, 3)
        found[self.chosen] += (self._parts(self.chosen).left @ self.forces.ravel()).reshape(-1, 3)
        found[self.chosen] += (self._dents @ self.forces[:, :, None])[:, :, 0] / 2
        return found

    def slope(self) -> np.ndarray:
        """(k, k) mm/N: derivative of `rows` by w, less C_ss."""
        change = self._change[len(self.C_es) :]
        if self.share == 1.0:
            return change
        first, more = self._first, self._more
        by_w = self.C_ss @ first / (first @ first) - 2 / self.share * (change @ more) / (more @ more)
        return change + np.outer(self.share / 2 * more, by_w)

    def compliance(self) -> np.ndarray:
        """(3 c, 3 c) mm/N: derivative of the chosen patches' places by the forces on them. It is symmetric where all of
        the second order is taken."""
        parts, c = self._parts(self.chosen), len(self.chosen)
        if not self.w.any():
            return parts.total
        found, dents, each = parts.total + parts.U @ self.slope() @ parts.U.T, self._dents, np.arange(c)
        if (self.dent_share < 1.0).any():  # they depend on the forces too
            excess = self._excess.reshape(c, 9, 1)
            by_force = (parts.relative.reshape(c, 9, 3) * excess).sum(axis=1) / np.maximum(
                (excess**2).sum(axis=1), TRUSTED
            )
            by_force[self.dent_share == 1.0] = 0.0
            dents = dents - (dents @ self.forces[:, :, None]) / 2 * by_force[:, None]
        found.reshape(c, 3, c, 3)[each, :, each] += dents
        return found

    def unpressed(self, chosen: np.ndarray) -> np.ndarray:
        """(3 c, 3 c) mm/N: the same of any patches without forces, symmetric and positive semidefinite."""
        return self._parts(chosen).total

    def tip(self) -> np.ndarray:
        """(n_e,) mm that the effectors are moved by the forces."""
        n_e = len(self.C_es)
        if not len(self.chosen):
            return np.zeros(n_e)
        found = (self.C_es + self._change[:n_e] / 2) @ self.w
        own = (self.forces[:, None] @ self._parts(self.chosen).R)[:, 0]
        series = self.of.local_tip[:, :, self.chosen].reshape(len(self._at), -1)
        return found + (self._at @ series).reshape(n_e, -1) @ own.ravel()

    def relief(self) -> np.ndarray:
        """(n_a,) N by which the forces help the actuators to stay."""
        skin, w, terms = self.of.model.skin, self.w, len(self._at)
        found = w @ skin.gradient(self.delta, NONE) + skin.compliance_work(self.delta, NONE, w) / 2
        third = self.of.bent_slopes.reshape(-1, len(w) ** 2, len(w)) @ w @ np.outer(w, w).ravel()
        return found + self.share / 6 * (third.reshape(-1, terms) @ self._at)

    def _parts(self, chosen: np.ndarray) -> "_Parts":
        key = chosen.tobytes()
        if not len(chosen):
            none, blocks = np.zeros((0, 0)), np.zeros((0, 3, 3))
            return _Parts(np.zeros((0, len(self.C_ss))), none, none, blocks, blocks, np.zeros((0, 3, 3, 3)))
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
            dented = turn_cubic((self._at @ self.of.dented[:, chosen].reshape(terms, -1)).reshape(c, 3, 3, 3), R)
            own = total.reshape(c, 3, c, 3)[each, :, each]
            self._known = key, _Parts(U, left, total, own, R, dented)
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
    compliance, total (3 c, 3 c) all of it and own (c, 3, 3) its blocks on the diagonal, R (c, 3, 3) rotations since
    rest, dented (c, 3, 3, 3) mm/N^2 their E in the robot's axes."""

    U: np.ndarray
    left: np.ndarray
    total: np.ndarray
    own: np.ndarray
    R: np.ndarray
    dented: np.ndarray

    @cached_property
    def relative(self) -> np.ndarray:
        """(c, 3, 3, 3) 1/N: E by each patch's own compliance."""
        c = len(self.own)
        level = LEVEL * np.abs(self.own).max(initial=0.0) * np.eye(3)  # patches that are held yield nothing
        return np.linalg.solve(self.own + level, self.dented.reshape(c, 3, 9)).reshape(c, 3, 3, 3)


def _size(vector: np.ndarray) -> float:
    return float(np.sqrt(vector @ vector))
