"""The terms of Chebyshev series as trees of their degrees, which the C code sums from the leaves."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Group:
    """Terms of a series up to `end` that share all degrees but the last; depth: the coordinate from which on their sums
    are complete."""

    end: int
    depth: int
    degrees: list[int]


@dataclass(frozen=True)
class Tree:
    """order (M,) of the terms, by degree in the first coordinate, then in the second, ...; groups of terms that differ
    in the last coordinate only."""

    order: np.ndarray
    groups: list[Group]


def trees_of(indices: np.ndarray, kept: dict[str, np.ndarray]) -> tuple[np.ndarray, dict[str, Tree]]:
    """Order of the coordinates (n,), the same for all series, and the trees of the terms `kept` of each. It makes the
    fewest groups among the orders that differ in which coordinate is last."""
    n = indices.shape[1]
    best = None
    for last in range(n):
        axes = np.array([*(i for i in range(n) if i != last), last])
        trees = {name: _tree(indices[:, axes], terms) for name, terms in kept.items()}
        count = sum(len(tree.groups) for tree in trees.values())
        if best is None or count < best[0]:
            best = count, axes, trees
    return best[1:]


def _tree(indices: np.ndarray, kept: np.ndarray) -> Tree:
    """Tree of the terms `kept` (m,) of a series with degrees indices (M, n)."""
    order = kept[np.lexsort(indices[kept].T[::-1])]
    others = indices[order][:, :-1]
    apart = others[1:] != others[:-1]
    ends = np.append(np.flatnonzero(apart.any(axis=1)) + 1, len(order)) if len(order) else []
    # What a group adds to is complete from the first coordinate in which the next group differs.
    return Tree(
        order,
        [
            Group(int(end), int(apart[end - 1].argmax()) if end < len(order) else 0, others[end - 1].tolist())
            for end in ends
        ],
    )
