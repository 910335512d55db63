"""W of a model stays semidefinite where W_aa is: the compliance C = W_ee - W_ea W_aa^-1 W_ae of the effectors, the
actuators locked, is made the nearest semidefinite matrix (Higham, Computing a nearest symmetric positive semidefinite
matrix, Linear Algebra Appl. 103, 1988), and W = [C + G W_aa G^T, G W_aa; W_aa G^T, W_aa], G = W_ea W_aa^-1, follows.

Nearest in units of what the effectors' rows comply by, so that mm and rad are alike. Where the locked actuators leave
the effectors no motion in some direction C is singular, and what is learned of it is a little above zero or below."""

import numpy as np

FLOOR = 1e-12  # eigenvalue that C has at least, in these units: the rounding of W hides a smaller one


def nearest(C: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """The symmetric C (..., k, k) where no eigenvalue of it is below FLOOR, else the nearest such; sizes (k,): the
    square roots of the rows' compliance."""
    units = np.outer(sizes, sizes)
    scaled = C / units
    try:  # the usual case, at a fifth of the price
        np.linalg.cholesky(scaled - FLOOR * np.eye(len(sizes)))
        return C
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(scaled)
    raised = (vectors * np.maximum(values, FLOOR)[..., None, :]) @ vectors.swapaxes(-1, -2) * units
    return np.where(values[..., :1, None] < FLOOR, raised, C)


def with_nearest(W: np.ndarray, n_e: int, sizes: np.ndarray) -> np.ndarray:
    """W (..., n, n), rows e first, with the locked compliance that is in it replaced by its nearest. States at which
    W_aa is singular stay as they are."""
    e, a = slice(0, n_e), slice(n_e, None)
    determinate = np.linalg.cond(W[..., a, a]) < 1 / np.finfo(float).eps
    safe = np.where(determinate[..., None, None], W[..., a, a], np.eye(W.shape[-1] - n_e))
    locked = W[..., e, e] - W[..., e, a] @ np.linalg.solve(safe, W[..., a, e])
    change = nearest(locked, sizes) - locked
    W[..., e, e] += np.where(determinate[..., None, None], change, 0.0)
    return W
