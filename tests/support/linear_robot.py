"""A robot whose W and delta_free are the same everywhere: two actuators move an effector in its plane."""

import numpy as np

from cfem.condensed import Condensed, Rows

ROWS = Rows(("tip.x", "tip.y"), ("one", "two"))
REST_E = np.array([5.0, -3.0])
REACH = np.array([[-20.0, 20.0], [-20.0, 20.0]])
W_EA, W_AA = np.array([[1.5, -0.4], [0.3, 2.0]]), np.array([[1.0, 0.3], [0.3, 1.4]])


class LinearRobot:
    """W / stiffness; the protocol of a model."""

    def __init__(self, stiffness: float = 1.0):
        C = 0.05 * np.eye(2)
        W_ee = W_EA @ np.linalg.inv(W_AA) @ W_EA.T + C
        self.W = np.block([[W_ee, W_EA], [W_EA.T, W_AA]]) / stiffness

    def at_displacement(self, delta_a: np.ndarray) -> Condensed:
        return Condensed(ROWS, self.W, np.zeros(4), np.linalg.solve(self.W[2:, 2:], delta_a))
