"""The sparsity pattern of the tangent stiffness, fixed once: lower triangle, compressed columns, free nodes only."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp


@dataclass(frozen=True)
class Pattern:
    """n_free: of nodes; free: (n_free,) their indices; number: (n,) place of each node among the free, -1 where held;
    indptr, indices: of the lower triangle in compressed columns, rows ascending;
    cells: (m, n_nodes, n_nodes, 3) slots of the element blocks; cliques: likewise (k, k, 3) for each clique.

    A slot is the place in the data array where column j of the 3 x 3 block (a, b) begins, such that entry (i, j) lies
    at slot + i (for a diagonal block, i >= j); -1 where the block is above the diagonal or a node is held."""

    free: np.ndarray
    number: np.ndarray
    indptr: np.ndarray
    indices: np.ndarray
    cells: np.ndarray
    cliques: tuple[np.ndarray, ...]

    @property
    def n_dof(self) -> int:
        return 3 * len(self.free)

    @property
    def nnz(self) -> int:
        return len(self.indices)


def make_pattern(n_nodes: int, cells: np.ndarray, fixed: np.ndarray, cliques: Sequence[np.ndarray] = ()) -> Pattern:
    """Couples the nodes of every cell (m, k) and of every clique (k,) (a constraint whose curvature couples them)."""
    number = np.zeros(n_nodes, dtype=np.int64)
    number[fixed] = -1
    free = np.flatnonzero(number == 0)
    number[free] = np.arange(len(free))
    groups = [number[cells]] + [number[clique][None, :] for clique in cliques]
    keys = np.unique(np.concatenate([np.unique(_keys(group, len(free))) for group in groups]))
    keys = keys[keys >= 0]
    column, row = np.divmod(keys, max(len(free), 1))
    first = np.searchsorted(column, np.arange(len(free) + 1))  # place of each node column's diagonal block
    blocks = np.diff(first)
    # columns 3c, 3c+1, 3c+2 hold 3, 2, 1 entries of the diagonal block and 3 of each block below it
    lengths = np.where(blocks[:, None] > 0, (3 * (blocks - 1))[:, None] + np.array([3, 2, 1]), 0)
    indptr = np.concatenate([[0], np.cumsum(lengths.ravel())])
    starts = indptr[:-1].reshape(-1, 3)
    place = np.arange(len(keys)) - first[column]  # 0 for the diagonal block
    slot = starts[column] + np.where(place[:, None] == 0, -np.arange(3), 3 * place[:, None] - np.arange(3))
    indices = np.empty(indptr[-1], dtype=np.int64)
    for j in range(3):
        for i in range(3):
            wanted = (place > 0) | (i >= j)
            indices[slot[wanted, j] + i] = 3 * row[wanted] + i
    slots = [_slots(group, len(free), keys, slot) for group in groups]
    return Pattern(free, number, indptr, indices, slots[0], tuple(s[0] for s in slots[1:]))


def _keys(groups: np.ndarray, n: int) -> np.ndarray:
    """(m, k, k) column * n + row of the nodal block (row a, column b), -1 above the diagonal or at held nodes."""
    row, column = groups[:, :, None], groups[:, None, :]
    return np.where((row >= column) & (column >= 0), column * n + row, -1)


def _slots(groups: np.ndarray, n: int, keys: np.ndarray, slot: np.ndarray) -> np.ndarray:
    wanted = _keys(groups, n)
    found = (
        slot[np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)] if len(keys) else np.zeros((*wanted.shape, 3))
    )
    return np.where(wanted[..., None] >= 0, found, -1).astype(np.int32)


def add_blocks(matrix: np.ndarray, slots: np.ndarray, data: np.ndarray) -> None:
    """Adds a symmetric (3 k, 3 k) matrix of a clique to the lower triangle in `data`, slots (k, k, 3)."""
    blocks = matrix.reshape(len(slots), 3, len(slots), 3)
    for i in range(3):
        for j in range(3):
            keep = slots[:, :, 0] >= 0
            if i < j:
                keep = keep & ~np.eye(len(slots), dtype=bool)
            np.add.at(data, slots[:, :, j][keep] + i, blocks[:, i, :, j][keep])


def symmetric_product(pattern: Pattern, data: np.ndarray, B: np.ndarray) -> np.ndarray:
    """A B for the symmetric A whose lower triangle is `data`; B (n_dof, k)."""
    n = pattern.n_dof
    lower = sp.csc_array((data, pattern.indices, pattern.indptr), shape=(n, n))
    return lower @ B + lower.T @ B - lower.diagonal()[:, None] * B
