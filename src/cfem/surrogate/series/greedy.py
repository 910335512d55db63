"""Index sets that grow where the samples say that a series lacks something.

From all terms of degree 2 on, where these fit, those neighbours are added whose columns the residual of the fit so far
leans on most, as in orthogonal matching pursuit (Pati, Rezaiifar, Krishnaprasad 1993): as many as explain half of what
all neighbours do (bulk chasing, Doerfler 1996). A neighbour is a multi-index all of whose smaller ones are in the set
(Gerstner and Griebel, Computing 71, 2003), so that every set is closed under differentiation. Coordinates that matter
little, and products of many, get few terms: with a dozen inputs a set of total degree mostly consists of them."""

import numpy as np

from cfem.surrogate.series.chebyshev import design_rows, index_set
from cfem.surrogate.series.observations import Derivative

WHOLE = 2  # degree up to which all terms are there: where a function is even, those above lean on terms that are 0
BULK = 0.5  # share of what the neighbours explain that each step adds
GROWTH = 0.25  # of the set, the most that a step adds
RIDGE = 1e-12  # of the largest diagonal entry of the normal matrix


def greedy_set(
    z: np.ndarray,
    targets: np.ndarray,
    derivatives: tuple[Derivative, ...],
    divisors: np.ndarray,
    max_terms: int,
    max_degree: int,
) -> tuple[np.ndarray, list[int]]:
    """Multi-indices (M, n) in the order in which they were added, M <= max_terms, and the size of the set after each
    step. targets (m, k, q), divisors (k,) as `Observations.scaled`."""
    n = z.shape[1]
    indices, _ = index_set(np.ones(n), max(max_terms // 2, 1), WHOLE)
    b = targets.reshape(-1, targets.shape[2])

    def columns(wanted: np.ndarray, closed: np.ndarray) -> np.ndarray:
        rows = design_rows(z, closed, derivatives)[:, :, wanted] / divisors[:, None]
        return rows.reshape(-1, rows.shape[2])

    A = columns(np.arange(len(indices)), indices)
    G, right = A.T @ A, A.T @ b
    sizes = [len(indices)]
    while len(indices) < max_terms:
        more = neighbours(indices, max_degree)
        if not len(more):
            break
        residual = b - A @ _solve(G, right)
        new = columns(len(indices) + np.arange(len(more)), np.vstack([indices, more]))
        gain = ((new.T @ residual) ** 2).sum(axis=1) / np.maximum((new**2).sum(axis=0), 1e-300)
        chosen = _bulk(gain, min(max_terms - len(indices), max(8, int(GROWTH * len(indices)))))
        new = new[:, chosen]
        cross = A.T @ new
        G = np.block([[G, cross], [cross.T, new.T @ new]])
        A, right = np.hstack([A, new]), np.vstack([right, new.T @ b])
        indices = np.vstack([indices, more[chosen]])
        sizes.append(len(indices))
    return indices, sizes


def neighbours(indices: np.ndarray, max_degree: int) -> np.ndarray:
    """Multi-indices (M', n) one above a closed set (M, n), all of whose smaller neighbours are in it."""
    known, above = set(map(tuple, indices.tolist())), {}
    for k in indices.tolist():
        if sum(k) >= max_degree:
            continue
        for axis in range(len(k)):
            candidate = (*k[:axis], k[axis] + 1, *k[axis + 1 :])
            if candidate in known or candidate in above:
                continue
            below = (
                (*candidate[:j], candidate[j] - 1, *candidate[j + 1 :]) for j in range(len(candidate)) if candidate[j]
            )
            if all(index in known for index in below):
                above[candidate] = None
    return np.array(list(above), dtype=np.int64).reshape(-1, indices.shape[1])


def _solve(G: np.ndarray, right: np.ndarray) -> np.ndarray:
    damped = G + RIDGE * np.diag(G).max() * np.eye(len(G))
    return np.linalg.solve(damped, right)


def _bulk(gain: np.ndarray, most: int) -> np.ndarray:
    """The fewest of largest gain that add up to their share of all, at most `most` of them."""
    order = np.argsort(-gain, kind="stable")
    count = int(np.searchsorted(np.cumsum(gain[order]), BULK * gain.sum())) + 1
    return order[: max(1, min(count, most))]
