"""Forces that nobody knows, as the noise of a step of the condensed dynamics.

Their covariance is in proportion to the stiffness, so that no direction of the robot is pushed more than another."""

import numpy as np

from cfem.motion.model import MotionTerms


def slope_by_force(A: np.ndarray, n_q: int, dt: float) -> np.ndarray:
    """Slope (n_z, n_q) of the state after a step of `dt` seconds by forces on q; A (n_z, n_z): by that before.

    A force is like momentum, half of it before the step and half after: the midpoint rule's own way."""
    by_force = A[:, n_q : 2 * n_q].copy()
    by_force[n_q : 2 * n_q] += np.eye(n_q)
    return dt / 2 * by_force


def push_covariance(by_force: np.ndarray, place: MotionTerms, stiffness: float, free: slice, push: float) -> np.ndarray:
    """Covariance (n_z, n_z) of the state after a step, from forces that at rest would move the effectors by `push`
    mm.

    by_force (n_z, n_q): slope of the state by forces; free: numbers of q that no actuator holds."""
    K = stiffness * place.K[0, free, free]
    by_free = by_force[:, free]
    return push**2 / mean_compliance(place, free, K) * by_free @ K @ by_free.T


def mean_compliance(place: MotionTerms, free: slice, K: np.ndarray) -> float:
    """Mean compliance mm^2/J of the effectors' coordinates, where the numbers `free` of q move with the stiffness K."""
    J = effector_slope(place)[:, free]
    return float(np.trace(J @ np.linalg.solve(K, J.T)) / len(J))


def effector_slope(place: MotionTerms) -> np.ndarray:
    """Slope (n_e, n_q) of the effectors by q, without inner motions."""
    return np.concatenate([place.J[0], place.H[0]], axis=1)
