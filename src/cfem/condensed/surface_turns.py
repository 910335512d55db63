"""Rotations of parts of a surface since rest: the rotation that fits their nodes best (Kabsch, 1976)."""

import numpy as np
from scipy.sparse import csr_array


def members_of(triangles: np.ndarray, parts: np.ndarray, count: int) -> csr_array:
    """Matrix (count, m): 1 where a node is a corner of a triangle (t, 3) that touches a part, 0 elsewhere. parts (m,):
    of each node."""
    rows, nodes = np.repeat(parts[triangles], 3, axis=1).ravel(), np.tile(triangles, 3).ravel()
    members = csr_array((np.ones(len(nodes)), (rows, nodes)), shape=(count, len(parts)))
    members.data[:] = 1.0
    return members


def spread(members: csr_array, rest: np.ndarray, moved: np.ndarray) -> np.ndarray:
    """Sums (N, 3, 3) of (x - mean x) (X - mean X)^T over the nodes of each part, at rest X (m, 3) mm and at x, `moved`
    (m, 3) mm. It is linear in x, so that modes of displacement have theirs."""
    pairs = (members @ (moved[:, :, None] * rest[:, None]).reshape(len(rest), 9)).reshape(-1, 3, 3)
    sums = (members @ moved)[:, :, None] * (members @ rest)[:, None]
    return pairs - sums / members.sum(axis=1)[:, None, None]


def rotations(spreads: np.ndarray) -> np.ndarray:
    """Rotations (N, 3, 3) since rest of parts with these `spread` (N, 3, 3)."""
    left, _, right = np.linalg.svd(spreads)
    left[:, :, 2] *= np.sign(np.linalg.det(left @ right))[:, None]
    return left @ right
