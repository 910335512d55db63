"""A touchable robot with its actuators held, under forces on patches of its surface (`cfem.predict.touchable`).

How its rows go is known to the second order in the load w on the modes of the skin:

    rows = rows_0 + C_ss w + Q D_ss[v, v] / 2 + ...        v = Q^T w

with the mixtures Q of the modes that matter to D (`Touchable.bends`). The orders beyond follow as far as the energy
along the load tells them (`cfem.predict.high_order_load`). So do the dents, by which a force on a patch changes what
this patch yields. All of it is the derivative of one energy by the forces, so that the compliance is symmetric."""

import numpy as np

from cfem.predict import yielding
from cfem.predict.touchable import NONE, Touchable
from cfem.predict.yielding import Parts, loaded


class Held:
    """The robot at one delta_a (n_a,) mm. unloaded (k,) mm: rows of the skin without forces, free (N, 3) mm: places of
    the patches then; C_es (n_e, k) and C_ss (k, k) mm/N.

    chosen (c,), forces (c, 3) N: patches and what is on them since `bear`, none at first; w (k,) N: their load on the
    modes; rows (k,) mm under it; bending: the second order of what loads do to the modes over the first, the largest of
    all `bear`."""

    def __init__(self, of: Touchable, delta: np.ndarray):
        skin, k = of.model.skin, len(of.model.skin)
        self.of, self.delta, self.unloaded = of, delta, skin.rows(delta, NONE)
        self.C_es, self.C_ss = skin.compliance(delta, NONE)
        self._at = of.basis(of.in_box(delta))
        self._D = (self._at @ of.bent)[of.bent_at]
        self.free = of.patches.rest + (of.flat @ self.unloaded).reshape(-1, 3)
        self._known: tuple[bytes, Parts] | None = None
        self.chosen, self.forces = np.zeros(0, dtype=np.int64), np.zeros((0, 3))
        self.w, self.rows, self.bending = np.zeros(k), self.unloaded, 0.0

    def bear(self, chosen: np.ndarray, forces: np.ndarray) -> None:
        """Puts forces (c, 3) N on patches (c,), and takes all others off."""
        self.chosen, self.forces = chosen, forces
        if not len(chosen):
            self.w, self.rows = np.zeros(len(self.unloaded)), self.unloaded
            return
        parts, forces = self._parts(chosen), np.ascontiguousarray(forces, float)
        self._loaded = loaded(forces, self.C_ss, self.of.bends, self._D, parts.U, parts.yields, parts.dented)
        self.w, self.rows = self._loaded.w, self.unloaded + self._loaded.modes.motion
        self.bending = max(self.bending, self._loaded.bending)

    def places(self) -> np.ndarray:
        """(N, 3) mm of all patches. What is local is known of the chosen ones alone."""
        if not len(self.chosen):
            return self.free
        found = self.free + (self.of.flat @ self._loaded.modes.motion).reshape(-1, 3)
        local = (self._parts(self.chosen).left @ self.forces.ravel()).reshape(-1, 3)
        found[self.chosen] += local + self._loaded.places
        return found

    def compliance(self) -> np.ndarray:
        """(3 c, 3 c) mm/N: derivative of the chosen patches' places by the forces on them, symmetric."""
        parts, c, n_e = self._parts(self.chosen), len(self.chosen), len(self.C_es)
        if not self.w.any():
            return parts.total
        of, each = self._loaded.modes, np.arange(c)
        across, V = parts.U @ of.across, parts.U @ self.of.bends
        change = of.second * (V @ self._loaded.change[n_e:] @ V.T) + of.rank * np.outer(across, across)
        found = parts.total + (of.first - 1) * (parts.total - parts.left) + change
        found.reshape(c, 3, c, 3)[each, :, each] += self._loaded.slopes
        return found

    def unpressed(self, chosen: np.ndarray) -> np.ndarray:
        """(3 c, 3 c) mm/N: the same of any patches without forces, symmetric and positive semidefinite."""
        return self._parts(chosen).total

    def tip(self) -> np.ndarray:
        """(n_e,) mm that the effectors are moved by the forces."""
        n_e = len(self.C_es)
        if not len(self.chosen):
            return np.zeros(n_e)
        parts, of = self._parts(self.chosen), self._loaded
        series = self.of.local_tip[:, :, self.chosen].reshape(len(self._at), -1)
        turned = (self.forces[:, None] @ parts.R)[:, 0]
        own = (self._at @ series).reshape(n_e, -1) @ turned.ravel()
        pairs = of.seconds[:, None, None] / 2 * self.forces[:, :, None] * self.forces[:, None]
        dented = pairs.ravel() @ parts.dented[..., 3:].reshape(-1, n_e)
        by_modes = of.modes.first * self.C_es @ self.w + of.modes.second / 2 * of.change[:n_e] @ of.v
        return by_modes + own + dented

    def relief(self) -> np.ndarray:
        """(n_a,) N by which the forces help the actuators to stay."""
        skin, w = self.of.model.skin, self.w
        if not len(self.chosen):
            return np.zeros(len(self.delta))
        more, v = self._loaded.modes, self._loaded.v
        found = w @ skin.gradient(self.delta, NONE) + more.first * skin.compliance_work(self.delta, NONE, w) / 2
        series, (i, j, k), slopes = self.of.cubic
        return found + more.second / 6 * (self._at @ slopes @ (series @ (v[i] * v[j] * v[k])))

    def _parts(self, chosen: np.ndarray) -> Parts:
        key = chosen.tobytes()
        if self._known is None or self._known[0] != key:
            of, R = self.of, self.of.turns(self.unloaded, chosen)
            U, left, total, dented = yielding.parts(chosen, of.U, self.C_ss, R, self._at, of.local, of.dented)
            try:
                np.linalg.cholesky(total)
            except np.linalg.LinAlgError:
                sizes, axes = np.linalg.eigh(total)
                nearest = (axes * np.maximum(sizes, 0.0)) @ axes.T
                left, total = left + (nearest - total), nearest
            c, each = len(chosen), np.arange(len(chosen))
            yields = stiff(total.reshape(c, 3, c, 3)[each, :, each])
            self._known = key, Parts(U, left, total, yields, R, dented)
        return self._known[1]


def stiff(own: np.ndarray) -> np.ndarray:
    """(c,) harmonic means of the eigenvalues of own (c, 3, 3), near those of what is local: a soft body yields in one
    or two directions, and is dented in all; 0 where the body is held."""
    minors = sum(own[:, i, i] * own[:, j, j] - own[:, i, j] ** 2 for i, j in ((0, 1), (0, 2), (1, 2)))
    return 3 * np.linalg.det(own) / np.where(minors > 0, minors, np.inf)
