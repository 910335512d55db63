"""The sparsity pattern of the tangent stiffness, fixed once: lower triangle, compressed columns, free nodes only."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit

from cfem.mechanics import compiling  # noqa: F401 - says so where a kernel is compiled


@dataclass(frozen=True)
class Pattern:
    """Sparsity pattern of the tangent stiffness. A slot is the place in the data array where column j of the 3 x 3
    block (a, b) begins, such that entry (i, j) lies at slot + i (for a diagonal block, i >= j); -1 where the block is
    above the diagonal or a node is held.

    free: (k,) indices of the free nodes
    number: (n,) place of each node among the free, -1 where held
    indptr, indices: of the lower triangle in compressed columns, rows ascending
    slots: for each group of nodes (g, k) that was coupled, (g, k, k, 3)"""

    free: np.ndarray
    number: np.ndarray
    indptr: np.ndarray
    indices: np.ndarray
    slots: tuple[np.ndarray, ...]

    @property
    def n_dof(self) -> int:
        return 3 * len(self.free)

    @property
    def nnz(self) -> int:
        return len(self.indices)

    def blocks(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Nodes and slot of every nodal block: the node of its row (m,), that of its column (m,), and (m, 3)."""
        column = np.repeat(np.arange(len(self.free)), np.diff(self.indptr)[::3] // 3)
        slot = _slots_of_blocks(self.indptr, column, np.arange(len(column)) - np.searchsorted(column, column))
        return self.free[self.indices[slot[:, 0]] // 3], self.free[column], slot


def make_pattern(n_nodes: int, groups: Sequence[np.ndarray], fixed: np.ndarray) -> Pattern:
    """Couples the nodes in every row of every group (g, k): the cells, and the cliques of constraints whose curvature
    couples them. A node -1 stands for none; no row names a node twice."""
    number = np.zeros(n_nodes + 1, dtype=np.int64)  # the last for node -1
    number[fixed] = -1
    number[-1] = -1
    free = np.flatnonzero(number == 0)
    number[free] = np.arange(len(free))
    numbered = [number[group] for group in groups]
    keys = np.unique(np.concatenate([np.unique(_keys(group, len(free))) for group in numbered]))
    keys = keys[keys >= 0]
    column, row = np.divmod(keys, max(len(free), 1))
    first = np.searchsorted(column, np.arange(len(free) + 1))  # place of each node column's diagonal block
    blocks = np.diff(first)
    # columns 3c, 3c+1, 3c+2 hold 3, 2, 1 entries of the diagonal block and 3 of each block below it
    lengths = np.where(blocks[:, None] > 0, (3 * (blocks - 1))[:, None] + np.array([3, 2, 1]), 0)
    indptr = np.concatenate([[0], np.cumsum(lengths.ravel())])
    place = np.arange(len(keys)) - first[column]
    slot = _slots_of_blocks(indptr, column, place)
    indices = np.empty(indptr[-1], dtype=np.int64)
    for j in range(3):
        for i in range(3):
            wanted = (place > 0) | (i >= j)
            indices[slot[wanted, j] + i] = 3 * row[wanted] + i
    slots = tuple(_slots(group, len(free), keys, slot) for group in numbered)
    return Pattern(free, number[:-1], indptr, indices, slots)


def _slots_of_blocks(indptr: np.ndarray, column: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Slots (m, 3) of blocks (m,) by their node column and their place in it, 0 for the diagonal block."""
    starts = indptr[:-1].reshape(-1, 3)[column]
    return starts + np.where(place[:, None] == 0, -np.arange(3), 3 * place[:, None] - np.arange(3))


def _keys(groups: np.ndarray, n: int) -> np.ndarray:
    """Keys (m, k, k) column * n + row of the nodal block (row a, column b), -1 above the diagonal or at held nodes."""
    row, column = groups[:, :, None], groups[:, None, :]
    return np.where((row >= column) & (column >= 0), column * n + row, -1)


def _slots(groups: np.ndarray, n: int, keys: np.ndarray, slot: np.ndarray) -> np.ndarray:
    wanted = _keys(groups, n)
    slots = (
        slot[np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)] if len(keys) else np.zeros((*wanted.shape, 3))
    )
    return np.where(wanted[..., None] >= 0, slots, -1).astype(np.int32)


def add_blocks(matrices: np.ndarray, slots: np.ndarray, data: np.ndarray) -> None:
    """Adds symmetric matrices (g, 3 k, 3 k) of a group to the lower triangle in `data`, slots (g, k, k, 3)."""
    _add_blocks(np.ascontiguousarray(matrices), slots, data)


@njit(cache=True)
def _add_blocks(matrices, slots, data):
    """Adds matrices (g, 3 k, 3 k) to the lower triangle `data` at their slots (g, k, k, 3)."""
    g, k = slots.shape[:2]
    for e in range(g):
        for a in range(k):
            for b in range(k):
                if slots[e, a, b, 0] >= 0:
                    for j in range(3):
                        for i in range(j if a == b else 0, 3):
                            data[slots[e, a, b, j] + i] += matrices[e, 3 * a + i, 3 * b + j]


def symmetric_product(pattern: Pattern, data: np.ndarray, B: np.ndarray) -> np.ndarray:
    """A B for the symmetric A whose lower triangle is `data`; B (n_dof, k)."""
    out = np.zeros(B.shape)
    _symmetric_product(pattern.indptr, pattern.indices, data, np.ascontiguousarray(B, float), out)
    return out


@njit(cache=True)
def _symmetric_product(indptr, indices, data, B, out):
    """Adds A B to out (n, k), A by its lower triangle."""
    for j in range(len(indptr) - 1):
        for p in range(indptr[j], indptr[j + 1]):
            i, a = indices[p], data[p]
            for c in range(B.shape[1]):
                out[i, c] += a * B[j, c]
            if i != j:
                for c in range(B.shape[1]):
                    out[j, c] += a * B[i, c]
