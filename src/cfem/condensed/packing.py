"""Symmetric matrices as their upper triangle, row by row: W[0,0], W[0,1], ..., W[1,1], ...; tensors likewise."""

from functools import lru_cache
from itertools import combinations_with_replacement, permutations

import numpy as np


@lru_cache(maxsize=64)
def packed_indices(n: int, order: int = 2) -> np.ndarray:
    """Indices i <= j <= ... (order, entries) of the packed entries of a tensor (n, ..., n) of this order, symmetric in
    all of them."""
    return np.array(list(combinations_with_replacement(range(n), order)), dtype=np.int64).reshape(-1, order).T


def unpacking(n: int, order: int = 2) -> np.ndarray:
    """Position (n, ..., n) of each entry of a symmetric tensor of this order among its packed entries."""
    position, indices = np.empty((n,) * order, dtype=np.int64), packed_indices(n, order)
    for places in permutations(indices):
        position[places] = np.arange(indices.shape[1])
    return position


def pack_upper(matrix: np.ndarray) -> np.ndarray:
    """Upper triangles (..., n (n + 1) / 2) of symmetric matrices (..., n, n)."""
    rows, columns = packed_indices(matrix.shape[-1])
    return matrix[..., rows, columns]


def entries(W: np.ndarray, delta_free: np.ndarray) -> np.ndarray:
    """Entries (..., n (n + 3) / 2) of W (..., n, n) and delta_free (..., n): the upper triangle of W, then
    delta_free."""
    return np.concatenate([pack_upper(W), delta_free], axis=-1)


def unpack_upper(packed: np.ndarray) -> np.ndarray:
    """Symmetric matrices (..., n, n) of their upper triangles (..., n (n + 1) / 2)."""
    n = int((np.sqrt(8 * packed.shape[-1] + 1) - 1) / 2)
    if n * (n + 1) // 2 != packed.shape[-1]:
        raise ValueError(f"{packed.shape[-1]} entries are no upper triangle")
    rows, columns = packed_indices(n)
    matrix = np.empty((*packed.shape[:-1], n, n), dtype=packed.dtype)
    matrix[..., rows, columns] = packed
    matrix[..., columns, rows] = packed
    return matrix
