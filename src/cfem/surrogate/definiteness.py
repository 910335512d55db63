"""Definiteness of W all over the domain: the share of states where it is positive definite, and the worst one."""

from typing import Any

import numpy as np

from cfem.condensed.parameters import completed, values
from cfem.predict.protocol import Predictor
from cfem.surrogate.series.observations import inputs, parameters_of

AT_ONCE = 5000


def definiteness(predictor: Predictor, dataset: Any, queries: int) -> dict[str, Any]:
    """Share of `queries` random points between the training states at which W is positive definite; the smallest
    eigenvalue of W scaled to a unit diagonal, and the input at which it was found."""
    s, p = between(predictor, dataset, queries, 0)
    smallest = np.concatenate(
        [
            smallest_eigenvalue(predictor.evaluate(s[first : first + AT_ONCE], p[first : first + AT_ONCE])[0])
            for first in range(0, queries, AT_ONCE)
        ]
    )
    worst = int(np.argmin(smallest))
    return {
        "queries": queries,
        "share": float(np.mean(smallest > 0)),
        "smallest_eigenvalue": float(smallest[worst]),
        "where": {"s": s[worst].tolist(), "p": p[worst].tolist()},
    }


def between(predictor: Predictor, dataset: Any, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Arguments s, p of `Predictor.evaluate` at `count` random points between the training states."""
    s, q = random_states(*inputs(dataset, predictor.form), count, seed)
    return s, completed(predictor.parameters, values(parameters_of(dataset), q))


def smallest_eigenvalue(W: np.ndarray) -> np.ndarray:
    """Smallest eigenvalues (m,) of D W D with unit diagonal, W (m, n, n) symmetric: of the same sign as W's, and free
    of units; where a diagonal entry is negative, no more than -1."""
    diagonal = np.einsum("mii->mi", W)
    size = np.sqrt(np.abs(np.where(diagonal == 0, 1.0, diagonal)))
    return np.linalg.eigvalsh(W / size[:, :, None] / size[:, None, :])[:, 0]


def random_states(s: np.ndarray, q: np.ndarray, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """`count` random points between the states s (m, n_a), q (m, n_q): convex combinations of n_a + n_q + 1 of them,
    many of which are near to one."""
    t = np.hstack([s, q])
    rng = np.random.default_rng(seed)
    corners = t.shape[1] + 1
    shares = rng.dirichlet(np.full(corners, 0.5), size=count)
    mixed = np.zeros((count, t.shape[1]))
    for corner in range(corners):
        mixed += shares[:, corner, None] * t[rng.integers(len(t), size=count)]
    return mixed[:, : s.shape[1]], mixed[:, s.shape[1] :]
