"""Where some coordinates of a held patch come to rest under the forces of the actuators and its other coordinates."""

from collections.abc import Sequence

import numpy as np


def resting(W: np.ndarray, n_a: int, free: Sequence[int]) -> np.ndarray:
    """Rest of the coordinates `free` of a pose (n,) to first order: (n, n_a + n), zero rows for the others, times
    (forces of the n_a actuators in N, pose in mm and rad).

    W (n_a + n, n_a + n): compliance of actuators and pose. With forces w on the other coordinates o and none on the
    free ones f, p_o = W_oa lambda_a + W_oo w and p_f = W_fa lambda_a + W_fo w; w eliminated."""
    n = len(W) - n_a
    free = list(free)
    held = [i for i in range(n) if i not in free]
    a, f, o = np.arange(n_a), n_a + np.array(free, dtype=int), n_a + np.array(held, dtype=int)
    by_pose = np.linalg.solve(W[np.ix_(o, o)], W[np.ix_(o, f)]).T
    out = np.zeros((n, n_a + n))
    out[np.ix_(free, a)] = W[np.ix_(f, a)] - by_pose @ W[np.ix_(o, a)]
    out[np.ix_(free, o)] = by_pose
    return out
