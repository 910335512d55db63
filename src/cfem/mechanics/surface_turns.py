"""Rotations of parts of a surface since rest: the rotation that fits their nodes best (Kabsch, 1976)."""

import numpy as np
from numba import njit
from scipy.sparse import csr_array

from cfem.mechanics.material.tensor import cofactor, rotation


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


@njit(cache=True, error_model="numpy")
def rotations(spreads):
    """Rotations (N, 3, 3) since rest of parts with these `spread` (N, 3, 3) A.

    With A = R S, S symmetric of values a, b and c, also the matrix of cofactors is R times a symmetric one, of values b
    c, a c and a b. Their weighted sum has the same rotation, and is far from singular where the part is flat, c = 0."""
    R, D, cofactors = np.empty(spreads.shape), np.empty((3, 3)), np.empty((3, 3))
    for p in range(len(spreads)):
        A, size = spreads[p], 0.0
        cofactor(A, cofactors)
        for i in range(3):
            for j in range(3):
                size += A[i, j] ** 2
        size = np.sqrt(size)
        for i in range(3):
            for j in range(3):
                D[i, j] = (A[i, j] + cofactors[i, j] / size) / size - (1.0 if i == j else 0.0)
        rotation(D, R[p])
    return R
