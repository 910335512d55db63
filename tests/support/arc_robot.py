"""A two-cable robot in closed form: an arc of 120 mm that bends in y-z, with all identities between W and its
energy exact.

s = (d_left + d_right) / 2 bends it by s / 20 rad, d_left - d_right moves its tip in x.
Psi = k s^2 / 2 + q s^4 / 4 + h (1 + g s) d^2 / 2; lambda = grad Psi; W_aa = (hess Psi)^-1; W_ea = grad e
W_aa."""

import numpy as np

from cfem.condensed import Condensed, Rows
from cfem.core.errors import NumericalError

ROWS = Rows(("tip.x", "tip.y", "tip.z"), ("left", "right"))
REST_E = np.array([0.0, 10.0, -120.0])
REACH = np.array([[0.0, 20.0], [0.0, 20.0]])
LENGTH = 120.0
_TO_SD = np.array([[0.5, 0.5], [1.0, -1.0]])
_K, _Q, _H, _G = 0.9, 3e-4, 1.5, 0.02


def tip(delta_a: np.ndarray) -> np.ndarray:
    """(3,) mm from rest."""
    s, d = _TO_SD @ delta_a
    theta = max(s, 1e-9) / 20 if s >= 0 else min(s, -1e-9) / 20
    return np.array(
        [0.8 * d * (1 + 0.02 * s), LENGTH * (1 - np.cos(theta)) / theta, LENGTH * (1 - np.sin(theta) / theta)]
    )


def gradient(delta_a: np.ndarray) -> np.ndarray:
    """(3, 2) grad e by complex-free central differences: exact to 1e-9, which is exact enough here."""
    h = 1e-4
    columns = [(tip(delta_a + h * unit) - tip(delta_a - h * unit)) / (2 * h) for unit in np.eye(2)]
    return np.column_stack(columns)


class ArcRobot:
    """The protocol of a model; counts its queries and refuses states beyond `limit` mm."""

    rows, rest_e, reach, length = ROWS, REST_E, REACH, LENGTH

    def __init__(self, limit: float = np.inf, stiffness: float = 1.0):
        self.limit, self.stiffness, self.queries = limit, stiffness, 0

    def at_displacement(self, delta_a: np.ndarray) -> Condensed:
        self.queries += 1
        delta_a = np.asarray(delta_a, float)
        if np.abs(delta_a).max() > self.limit:
            raise NumericalError("beyond the limit")
        s, d = _TO_SD @ delta_a
        lam = self.stiffness * _TO_SD.T @ [_K * s + _Q * s**3 + _H * _G * d**2 / 2, _H * (1 + _G * s) * d]
        hessian = np.array([[_K + 3 * _Q * s**2, _H * _G * d], [_H * _G * d, _H * (1 + _G * s)]])
        W_aa = np.linalg.inv(self.stiffness * _TO_SD.T @ hessian @ _TO_SD)
        slope = gradient(delta_a)
        W = np.empty((5, 5))
        W[3:, 3:] = W_aa
        W[:3, 3:] = slope @ W_aa
        W[3:, :3] = W[:3, 3:].T
        W[:3, :3] = 0.1 * np.eye(3) + slope @ W_aa @ slope.T
        delta_free = np.concatenate([tip(delta_a), delta_a]) - W[:, 3:] @ lam
        return Condensed(ROWS, W, delta_free, lam)

    def inside(self, condensed: Condensed) -> bool:
        return bool((np.abs(condensed.delta_a) <= 20).all())

    def distance(self, condensed: Condensed) -> float:
        return float(np.abs(condensed.delta_a).max() / 20)
