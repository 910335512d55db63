"""model.json: all that a user of a trained model must know besides its weights."""

from typing import Any

import numpy as np

from cfem.core.files import plain
from cfem.core.provenance import versions
from cfem.predict.domain import Domain
from cfem.predict.load import FORMAT

UNITS = {"delta_a": "mm", "lambda_a": "N", "delta_e": "mm", "W": "mm/N", "delta_free": "mm", "energy": "N mm"}


def model_card(kind: str, dataset: Any, **more: Any) -> dict[str, Any]:
    """dataset: the training states (cfem.dataset.reader.Dataset); more: errors, history, what the kind needs to run."""
    meta = dataset.meta
    return plain(
        {
            "format": FORMAT,
            "kind": kind,
            "scene": meta["scene"],
            "rows": {"effectors": dataset.rows.effectors, "actuators": dataset.rows.actuators},
            "units": UNITS,
            "rest_e": meta["rest_e"],
            "reach": meta["reach"],
            "length": meta["length"],
            "domain": Domain.of(dataset.delta_a, dataset.lambda_a).to_json(),
            "versions": versions(),
            **more,
        }
    )


def share_positive_definite(matrices: np.ndarray) -> dict[str, float]:
    """Of symmetric matrices (m, n, n): the share that is positive definite, and the smallest eigenvalue of all."""
    smallest = np.linalg.eigvalsh(matrices)[:, 0]
    return {"share": float(np.mean(smallest > 0)), "smallest_eigenvalue": float(smallest.min())}


def random_states(delta_a: np.ndarray, count: int, seed: int = 0) -> np.ndarray:
    """(count, n_a) random points between the training states (m, n_a): each a convex combination of n_a + 1 of them."""
    rng = np.random.default_rng(seed)
    corners = delta_a.shape[1] + 1
    chosen = delta_a[rng.integers(len(delta_a), size=(count, corners))]
    return np.einsum("ck,cki->ci", rng.dirichlet(np.ones(corners), size=count), chosen)
