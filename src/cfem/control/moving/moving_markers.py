"""Where markers stand on the skin of a robot that moves, by its state and the forces on it.

With inner motions eta beside the displacements delta_a of the actuators, modes s of the skin are at

    s = s_0(delta_a) + H eta + (C - H H_w^T / kappa) w / stiffness

C w is what forces w on chosen rows do at rest, actuators held, and H H_w^T / kappa its share that inner motions make:
the rest, of motions too stiff to swing, follows the forces at once. At rest that is the static model of
`cfem.predict.estimate`."""

import numpy as np

from cfem.core.errors import InputError
from cfem.motion.inner_skin import InnerSkin
from cfem.motion.model import MotionModel
from cfem.predict.estimate import Estimator
from cfem.predict.mode_series import ModeSeries


class MovingMarkers:
    """Linear maps of the modes: of the markers (3 m) and of all modes (k). Unknowns are (delta_a, eta, w, log
    stiffness), n_y = n_q + n_w + 1 of them."""

    def __init__(self, estimator: Estimator, motion: MotionModel):
        if motion.skin is None:
            what = "the model has not learned how its skin moves"
            raise InputError(what, do="sample with dynamics: true and a skin, and train again with this version")
        if motion.skin.modes != len(estimator.model.skin):
            what = f"its skin has {len(estimator.model.skin)} modes, and its motion knows {motion.skin.modes}"
            raise InputError(what, do="train it again")
        self._motion, self._loaded, self._n_e = motion, estimator.loaded_rows, motion.rows.n_e
        self._of_skin = bool((self._loaded >= self._n_e).any())
        self._seen = estimator.marker_series, motion.skin.mapped(estimator.marker_map)
        self._all = estimator.mode_series, motion.skin

    def seen(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(3 m,) mm of the markers from rest at y (n_y,), and its derivative (3 m, n_y)."""
        return self._mapped(*self._seen, y)

    def modes(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(k,) mm of the skin, likewise."""
        return self._mapped(*self._all, y)

    def loaded_paths(self, delta_a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """H_w (n_w, n_r) of the rows with forces, and its derivatives (n_a, n_w, n_r) by delta_a (n_a,) mm."""
        H, dH = self._motion.paths(delta_a)
        if self._of_skin:
            Hs, dHs = self._motion.skin(delta_a)
            H, dH = np.concatenate([H, Hs]), np.concatenate([dH, dHs], axis=1)
        return H[self._loaded], dH[:, self._loaded]

    def _mapped(self, series: ModeSeries, inner: InnerSkin, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        n_a, n_q, n_w = self._motion.n_a, self._motion.n_q, len(self._loaded)
        delta_a, eta, soft = y[:n_a], y[n_a:n_q], np.exp(-y[-1])
        w = soft * y[n_q : n_q + n_w]
        value, slope = series(delta_a, w)
        R, dR = inner(delta_a)
        by_a, by_w, swings = slope[:, :n_a], slope[:, n_a:], eta
        if n_w:
            H, dH = self.loaded_paths(delta_a)
            yields = 1 / self._motion.stiffness
            swings = eta - yields * H.T @ w
            by_w = by_w - yields * R @ H.T
            by_a = by_a - yields * R @ (dH.swapaxes(1, 2) @ w).T
        by_a = by_a + (dR @ swings).T
        by_log = -by_w @ w if n_w else np.zeros(len(value))
        return value + R @ swings, np.concatenate([by_a, R, soft * by_w, by_log[:, None]], axis=1)
