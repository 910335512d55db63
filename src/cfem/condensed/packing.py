"""Symmetric matrices as their upper triangle, row by row: W[0,0], W[0,1], ..., W[1,1], ...; tensors likewise."""

from functools import lru_cache
from itertools import combinations_with_replacement

import numpy as np


@lru_cache(maxsize=64)
def upper_indices(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Row and column index of each packed entry, both (n (n + 1) / 2,)."""
    return np.triu_indices(n)


def pack_upper(matrix: np.ndarray) -> np.ndarray:
    """Upper triangles (..., n (n + 1) / 2) of symmetric matrices (..., n, n)."""
    rows, columns = upper_indices(matrix.shape[-1])
    return matrix[..., rows, columns]


@lru_cache(maxsize=64)
def symmetric3_indices(n: int) -> np.ndarray:
    """Indices i <= j <= k (3, n (n + 1) (n + 2) / 6) of the packed entries of a tensor symmetric in all three."""
    return np.array(list(combinations_with_replacement(range(n), 3))).T


@lru_cache(maxsize=64)
def symmetric4_indices(n: int) -> np.ndarray:
    """Indices (4, n (n + 1) (n + 2) (n + 3) / 24) of the packed entries of a tensor symmetric in all four."""
    return np.array(list(combinations_with_replacement(range(n), 4))).T


def pack_symmetric3(tensor: np.ndarray) -> np.ndarray:
    """Packed entries (..., n (n + 1) (n + 2) / 6) of symmetric tensors (..., n, n, n)."""
    i, j, k = symmetric3_indices(tensor.shape[-1])
    return tensor[..., i, j, k]


def entries(W: np.ndarray, delta_free: np.ndarray) -> np.ndarray:
    """Entries (..., n (n + 3) / 2) of W (..., n, n) and delta_free (..., n): the upper triangle of W, then
    delta_free."""
    return np.concatenate([pack_upper(W), delta_free], axis=-1)


def unpack_upper(packed: np.ndarray) -> np.ndarray:
    """Symmetric matrices (..., n, n) of their upper triangles (..., n (n + 1) / 2)."""
    n = int((np.sqrt(8 * packed.shape[-1] + 1) - 1) / 2)
    if n * (n + 1) // 2 != packed.shape[-1]:
        raise ValueError(f"{packed.shape[-1]} entries are no upper triangle")
    rows, columns = upper_indices(n)
    matrix = np.empty((*packed.shape[:-1], n, n), dtype=packed.dtype)
    matrix[..., rows, columns] = packed
    matrix[..., columns, rows] = packed
    return matrix
