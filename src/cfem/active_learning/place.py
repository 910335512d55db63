"""Where the rows of a plan lie, as a model sees it, before any of them is solved."""

import numpy as np

from cfem.predict.protocol import Predictor
from cfem.surrogate.error_measures import state

ITERATIONS = 30
SETTLED = 1e-6  # of the range of the inputs: a smaller move ends the search


def place(
    predictor: Predictor, C: np.ndarray, target: np.ndarray, p: np.ndarray, start: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Inputs s (m, n_a) of the model at which C . delta_a = target (m,) under forces in the proportion C (m, n_a), a
    row of a pulling plan each (`pull` of cfem.equilibrium), and whether they were found (m,). start: (m, n_a).

    The condensed model solves its own linearisation: lambda = mu C, mu = (target - C delta_free) / (C W_aa C^T)."""
    a, s = predictor.rows.a, start.copy()
    scale = np.maximum(np.ptp(start, axis=0), 1e-12)
    moved = np.full(len(s), np.inf)
    for _ in range(ITERATIONS):
        active = moved > SETTLED
        if not active.any():
            break
        W, delta_free = predictor.evaluate(s[active], p[active])
        lean, free = np.einsum("mij,mj->mi", W[:, a, a], C[active]), delta_free[:, a]
        mu = (target[active] - (C[active] * free).sum(axis=1)) / (C[active] * lean).sum(axis=1)
        new = free + mu[:, None] * lean if predictor.form == "displacement" else mu[:, None] * C[active]
        step = np.abs((new - s[active]) / scale).max(axis=1)
        # the first steps may lead far beyond the data, where the model knows nothing
        new = s[active] + (new - s[active]) * np.minimum(1.0, 0.3 / np.maximum(step, 1e-300))[:, None]
        moved[active] = np.where(np.isfinite(step), step, 0.0)
        s[active] = np.where(np.isfinite(new), new, s[active])
    return s, moved <= SETTLED


def effectors(predictor: Predictor, s: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Displacements (m, n_e) mm of the effectors, at inputs s (m, n_a) of the model's form."""
    W, delta_free = predictor.evaluate(s, p)
    rows = predictor.rows
    if predictor.form == "displacement":
        return state(rows, W, delta_free, s)[1]
    return np.einsum("mij,mj->mi", W[:, rows.e, rows.a], s) + delta_free[:, rows.e]
