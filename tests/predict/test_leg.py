"""A learned leg whose effectors touch, against the energy of a hand-made robot."""

from types import SimpleNamespace

import numpy as np

from cfem.condensed import Condensed, Rows
from cfem.predict.leg import LearnedLeg

C = np.diag([2.0, 3.0, 4.0])
K = np.array([[5.0, 1.0], [1.0, 4.0]])
J = np.array([[1.0, 0.5], [0.0, 2.0], [-1.0, 0.3]])
ROWS = Rows(("foot.x", "foot.y", "foot.z"), ("left", "right"))


class Linear:
    """Psi = a . K a / 2, e = J a, locked compliance C."""

    def at_displacement(self, a):
        W_aa = np.linalg.inv(K)
        W_ea = J @ W_aa
        W = np.block([[C + W_ea @ J.T, W_ea], [W_ea.T, W_aa]])
        lam = K @ a
        return Condensed(ROWS, W, np.concatenate([J @ a, a]) - W[:, 3:] @ lam, lam)


def test_places_and_forces_are_those_of_the_linear_robot():
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    leg = LearnedLeg(Linear(), np.array([[1.0, 2.0, 3.0]]), turn, np.array([10.0, 0, 0]))
    np.testing.assert_allclose(leg.points, [[8.0, 1.0, 3.0]])
    a, f = np.array([0.3, -0.2]), np.array([0.1, 0.2, -0.4])
    found, yields = leg.respond(SimpleNamespace(target=a), J @ a + C @ f, None)
    np.testing.assert_allclose(yields, C, atol=1e-12)
    np.testing.assert_allclose(found.lambda_c, f, atol=1e-12)
    np.testing.assert_allclose(found.lambda_a, K @ a - J.T @ f, atol=1e-12)
