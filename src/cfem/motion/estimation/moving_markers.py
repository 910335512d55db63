"""Places of markers on the skin of a robot that moves, by its state and the forces on it.

With inner motions eta beside the displacements delta_a of the actuators, modes s of the skin are at

    s = s_0(delta_a) + H eta + (C - H H_w^T / kappa) w / stiffness

C w is what forces w on chosen rows do at rest, actuators held, and H H_w^T / kappa its share that inner motions make:
the rest, of motions too stiff to swing, follows the forces at once. At rest that is the static model of
`cfem.predict.estimation.estimate`."""

import numpy as np

from cfem.core.errors import InputError
from cfem.motion.inner_skin import InnerSkin
from cfem.motion.model import MotionModel
from cfem.predict.estimation.estimate import Estimator
from cfem.predict.series.modes import ModeSeries


class MovingMarkers:
    """The rows of measurement: markers (3 m) and modes (k) by the unknowns y = (delta_a, eta, w, log stiffness).

    inner: motions of markers, then of rows with forces, by inner motions; and of modes, then of these rows
    """

    def __init__(self, estimator: Estimator, motion: MotionModel):
        """Maps of the markers of `estimator` on what the skin of `motion` has learned. InputError where that does not
        fit."""
        if motion.skin is None:
            what = "the model has not learned how its skin moves"
            raise InputError(what, do="sample with dynamics: true and a skin, and train again with this version")
        if motion.skin.modes != len(estimator.model.skin):
            what = f"its skin has {len(estimator.model.skin)} modes, and its motion knows {motion.skin.modes}"
            raise InputError(what, do="train it again")
        n_e, k = motion.rows.n_e, motion.skin.modes
        self._motion, identity = motion, np.eye(n_e + k)
        loaded = identity[estimator.loaded_rows]
        of_markers = np.hstack([np.zeros((3 * len(estimator.markers), n_e)), estimator.marker_map])
        self.inner = tuple(motion.skin.mapped(np.vstack([rows, loaded])) for rows in (of_markers, identity[n_e:]))
        self._series = estimator.marker_series, estimator.mode_series

    def seen(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Displacements (3 m,) mm of the markers from rest at y (n_y,), and their derivative (3 m, n_y)."""
        return self._mapped(self._series[0], self.inner[0], y)

    def modes(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Modes (k,) mm of the skin at y (n_y,), and their derivative (k, n_y)."""
        return self._mapped(self._series[1], self.inner[1], y)

    def _mapped(self, series: ModeSeries, inner: InnerSkin, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """R eta and the statics of the rows R, less the share of these that inner motions make; and the derivative."""
        n_a, n_q, compliance = self._motion.n_a, self._motion.n_q, 1 / self._motion.stiffness
        delta_a, swings, soft = y[:n_a], y[n_a:n_q], np.exp(-y[-1])
        w = soft * y[n_q:-1]
        value, slope = series(delta_a, w)
        paths, by_place = inner(delta_a)
        r, by_y = len(value), np.empty((len(value), len(y)))
        R, H = paths[:r], paths[r:]
        swings = swings - compliance * w @ H
        by_y[:, :n_a] = slope[:, :n_a] + (by_place[:, :r] @ swings).T - compliance * R @ (w @ by_place[:, r:]).T
        by_y[:, n_a:n_q] = R
        by_w = slope[:, n_a:] - compliance * R @ H.T
        by_y[:, n_q:-1], by_y[:, -1] = soft * by_w, -by_w @ w
        return value + R @ swings, by_y
