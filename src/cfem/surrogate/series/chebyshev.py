"""Index sets of anisotropic total degree, and the derivatives of a basis at states."""

import numpy as np

from cfem.predict.series.chebyshev import basis
from cfem.predict.series.derivatives import derivative_matrices


def index_set(weights: np.ndarray, max_terms: int, max_degree: int) -> tuple[np.ndarray, np.ndarray]:
    """The largest set {k: weights . k <= d} of at most `max_terms` multi-indices, with d <= max_degree: (M, n) in the
    order of weights . k, so that the set of a lower d is a prefix, and that product (M,). weights: (n,) >= 1."""
    weights = np.asarray(weights, float)
    reached = np.inf
    degree = 1.0
    best = np.zeros((1, len(weights)), dtype=np.int64)
    while degree <= max_degree and reached:
        wider = _within(weights, degree, max_terms)
        if wider is None:
            break
        best = wider
        degree += 1.0
    order = best @ weights
    sorting = np.lexsort((*best.T[::-1], np.round(order, 9)))
    return best[sorting], order[sorting]


def _within(weights: np.ndarray, degree: float, max_terms: int) -> np.ndarray | None:
    """Multi-indices (M, n), all k with weights . k <= degree, None where they are more than max_terms."""
    indices = np.zeros((1, 0), dtype=np.int64)
    left = np.full(1, degree + 1e-9)
    for weight in weights:
        counts = (left / weight).astype(int) + 1
        if counts.sum() > max_terms:
            return None
        parents = np.repeat(np.arange(len(indices)), counts)
        powers = np.concatenate([np.arange(count) for count in counts])
        indices = np.column_stack([indices[parents], powers])
        left = left[parents] - weight * powers
    return indices


def design_rows(
    z: np.ndarray, indices: np.ndarray, derivatives: tuple[tuple[int, ...], ...], D: list | None = None
) -> np.ndarray:
    """Stated derivatives (m, k, M) of the basis at z (m, n)."""
    D = D or derivative_matrices(indices)
    known = {(): basis(z, indices)}
    for axes in sorted(derivatives, key=len):
        for end in range(1, len(axes) + 1):
            if axes[:end] not in known:
                known[axes[:end]] = known[axes[: end - 1]] @ D[axes[end - 1]]
    return np.stack([known[axes] for axes in derivatives], axis=1)
