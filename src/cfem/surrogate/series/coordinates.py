"""Box coordinates z of a model's inputs t = (s, q), along directions that matter differently."""

import numpy as np

BOX_MARGIN = 0.01  # of the range of the data: a polynomial of high degree grows fast outside its box


def box_coordinates(s: np.ndarray, q: np.ndarray, metric: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Box coordinates z = to_box t + offset in [-1, 1] on the states s (m, n_a), q (m, n_q): s turned to the principal
    axes of a symmetric form (n_a, n_a) per unit^2 of s, each parameter on its own."""
    spread = np.ptp(s, axis=0)
    spread = np.where(spread > 0, spread, 1.0)
    return _scaled(s, q, np.linalg.eigh(metric * np.outer(spread, spread))[1].T / spread)


def held_coordinates(
    s: np.ndarray, q: np.ndarray, hessian: np.ndarray, n_c: int, rests: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Box coordinates where the last n_c of s are the pose of a held patch, drawn with the actuators' forces: these, by
    the mean Hessian (n_a, n_a) of the energy, and the pose, less where it rests, `rests` (n_c, n_a) times (forces,
    pose), if that is how it was drawn. In displacements such states fill a thin slanted slab."""
    turn = np.eye(s.shape[1])
    actuators = s.shape[1] - n_c
    turn[:actuators] = hessian[:actuators]
    if rests is not None:
        turn[actuators:] -= rests @ turn
    return _scaled(s, q, turn)


def _scaled(s: np.ndarray, q: np.ndarray, axes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    n_a, n_q = s.shape[1], q.shape[1]
    turn = np.zeros((n_a + n_q, n_a + n_q))
    turn[:n_a, :n_a], turn[n_a:, n_a:] = axes, np.eye(n_q)
    y = np.hstack([s, q]) @ turn.T
    low, high = y.min(axis=0), y.max(axis=0)
    half = (0.5 + BOX_MARGIN) * np.where(high > low, high - low, 1.0)
    return turn / half[:, None], -(low + high) / 2 / half


def mean_square(second: np.ndarray, n: int) -> np.ndarray:
    """Mean (n, n) over states and components of H^2, of symmetric matrices H given as upper triangles (m, pairs, q). Of
    the second derivatives of a map its principal axes tell the directions along which the map bends from those along
    which it hardly does."""
    first_axis, second_axis = np.triu_indices(n)
    H = np.empty((len(second), second.shape[2], n, n))
    H[:, :, first_axis, second_axis] = H[:, :, second_axis, first_axis] = second.swapaxes(1, 2)
    return np.einsum("mqij,mqjk->ik", H, H) / len(H)
