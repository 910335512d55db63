"""Shape functions of triangles with three nodes, or with six: the corners and then the middles of their edges."""

import numpy as np

from cfem.mechanics.mesh import TRIANGLE_EDGES


def values(n_nodes: int, points: np.ndarray) -> np.ndarray:
    """Shape functions (q, n_nodes) at barycentric points (q, 3)."""
    if n_nodes == 3:
        return points.copy()
    first, second = points[:, TRIANGLE_EDGES].transpose(2, 0, 1)
    return np.concatenate([points * (2 * points - 1), 4 * first * second], axis=1)


def slopes(n_nodes: int, points: np.ndarray) -> np.ndarray:
    """Derivatives (q, n_nodes, 3) of the shape functions by the barycentric coordinates."""
    if n_nodes == 3:
        return np.repeat(np.eye(3)[None], len(points), axis=0)
    out = np.zeros((len(points), 6, 3))
    out[:, range(3), range(3)] = 4 * points - 1
    for edge, (a, b) in enumerate(TRIANGLE_EDGES, 3):
        out[:, edge, a], out[:, edge, b] = 4 * points[:, b], 4 * points[:, a]
    return out
