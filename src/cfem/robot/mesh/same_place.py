"""Nodes that lie at one place."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

_SAME = 1e-6  # of the diagonal: coordinates of four bytes are not better


def representatives(X: np.ndarray) -> np.ndarray:
    """Indices (n,): for each node X (n, 3) the first of those at its place."""
    pairs = cKDTree(X).query_pairs(_SAME * float(np.linalg.norm(np.ptp(X, axis=0))), output_type="ndarray")
    if len(pairs) == 0:
        return np.arange(len(X))
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(X), len(X)))
    _, label = connected_components(graph, directed=False)
    _, first = np.unique(label, return_index=True)
    return first[label]
