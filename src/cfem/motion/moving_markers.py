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
    stiffness), n_y = n_q + n_w + 1 of them.

    inner: what inner motions do to markers, then to rows with forces; and to modes, then to these"""

    def __init__(self, estimator: Estimator, motion: MotionModel):
        if motion.skin is None:
            what = "the model has not learned how its skin moves"
            raise InputError(what, do="sample with dynamics: true and a skin, and train again with this version")
        if motion.skin.modes != len(estimator.model.skin):
            what = f"its skin has {len(estimator.model.skin)} modes, and its motion knows {motion.skin.modes}"
            raise InputError(what, do="train it again")
        n_e, k = motion.rows.n_e, motion.skin.modes
        self._motion, own = motion, np.eye(n_e + k)
        loaded = own[estimator.loaded_rows]
        of_markers = np.hstack([np.zeros((3 * len(estimator.markers), n_e)), estimator.marker_map])
        self.inner = tuple(motion.skin.mapped(np.vstack([one, loaded])) for one in (of_markers, own[n_e:]))
        self._series = estimator.marker_series, estimator.mode_series

    def seen(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(3 m,) mm of the markers from rest at y (n_y,), and its derivative (3 m, n_y)."""
        return self._mapped(self._series[0], self.inner[0], y)

    def modes(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(k,) mm of the skin, likewise."""
        return self._mapped(self._series[1], self.inner[1], y)

    def _mapped(self, series: ModeSeries, inner: InnerSkin, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        n_a, n_q, yields = self._motion.n_a, self._motion.n_q, 1 / self._motion.stiffness
        delta_a, swings, soft = y[:n_a], y[n_a:n_q], np.exp(-y[-1])
        w = soft * y[n_q:-1]
        value, slope = series(delta_a, w)
        paths, by_place = inner(delta_a)
        r, by_y = len(value), np.empty((len(value), len(y)))
        R, H = paths[:r], paths[r:]
        swings = swings - yields * w @ H
        by_y[:, :n_a] = slope[:, :n_a] + (by_place[:, :r] @ swings).T - yields * R @ (w @ by_place[:, r:]).T
        by_y[:, n_a:n_q] = R
        by_w = slope[:, n_a:] - yields * R @ H.T
        by_y[:, n_q:-1], by_y[:, -1] = soft * by_w, -by_w @ w
        return value + R @ swings, by_y
