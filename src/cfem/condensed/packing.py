"""Symmetric matrices as their upper triangle, row by row: W[0,0], W[0,1], ..., W[1,1], ...; tensors likewise."""

from functools import lru_cache
from itertools import combinations_with_replacement

import numpy as np


@lru_cache(maxsize=64)
def upper_indices(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Row and column index of each packed entry, both (n (n + 1) / 2,)."""
    return np.triu_indices(n)


def pack_upper(matrix: np.ndarray) -> np.ndarray:
    """(..., n, n) symmetric -> (..., n (n + 1) / 2)."""
    rows, columns = upper_indices(matrix.shape[-1])
    return matrix[..., rows, columns]


@lru_cache(maxsize=64)
def symmetric3_indices(n: int) -> np.ndarray:
    """(3, n (n + 1) (n + 2) / 6) indices i <= j <= k of the packed entries of a tensor symmetric in all three."""
    return np.array(list(combinations_with_replacement(range(n), 3))).T


@lru_cache(maxsize=64)
def symmetric4_indices(n: int) -> np.ndarray:
    """(4, n (n + 1) (n + 2) (n + 3) / 24) likewise of one symmetric in all four."""
    return np.array(list(combinations_with_replacement(range(n), 4))).T


def pack_symmetric3(tensor: np.ndarray) -> np.ndarray:
    """(..., n, n, n) symmetric -> (..., n (n + 1) (n + 2) / 6)."""
    i, j, k = symmetric3_indices(tensor.shape[-1])
    return tensor[..., i, j, k]


def entries(W: np.ndarray, delta_free: np.ndarray) -> np.ndarray:
    """(..., n, n), (..., n) -> (..., n (n + 3) / 2): the upper triangle of W, then delta_free."""
    return np.concatenate([pack_upper(W), delta_free], axis=-1)


def unpack_upper(packed: np.ndarray) -> np.ndarray:
    """(..., n (n + 1) / 2) -> (..., n, n) symmetric."""
    n = int((np.sqrt(8 * packed.shape[-1] + 1) - 1) / 2)
    if n * (n + 1) // 2 != packed.shape[-1]:
        raise ValueError(f"{packed.shape[-1]} entries are no upper triangle")
    rows, columns = upper_indices(n)
    matrix = np.empty((*packed.shape[:-1], n, n), dtype=packed.dtype)
    matrix[..., rows, columns] = packed
    matrix[..., columns, rows] = packed
    return matrix
