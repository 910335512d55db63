"""Choice of the rows of a plan to solve next: those on which models fitted to parts of the data differ most, spread
out."""

from collections.abc import Sequence

import numpy as np

from cfem.active_learning.place import effectors
from cfem.predict.protocol import Predictor


def disagreement(full_model: Predictor, parts: Sequence[Predictor], s: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Disagreement (m,) mm: largest distance between an effector by the model of all data and by those of parts of it
    (query by committee, Seung, Opper and Sompolinsky 1992), at inputs s (m, n_a)."""
    expected = effectors(full_model, s, p).reshape(len(s), -1, 3)
    apart = [np.linalg.norm(effectors(part, s, p).reshape(expected.shape) - expected, axis=2) for part in parts]
    return np.max(apart, axis=(0, 2))


def choose(u: np.ndarray, score: np.ndarray, count: int, failed: np.ndarray | None = None) -> np.ndarray:
    """`count` (or all) indices into the rows u (m, n): again and again the one of the highest score, which then lowers
    the scores around it, over the distance at which `count` points would fill the cube. failed: (k, n) rows that could
    not be solved, around which others hardly will."""
    largest = np.max(score, where=np.isfinite(score), initial=0.0)
    remaining = np.maximum(np.where(np.isfinite(score), score, largest), 1e-300).astype(float)
    reach = 0.7 * count ** (-1 / u.shape[1])

    def lower(around: np.ndarray) -> np.ndarray:
        return remaining * -np.expm1(-((u - around) ** 2).sum(axis=1) / reach**2)

    for row in () if failed is None else failed:
        remaining = lower(row)
    chosen = []
    for _ in range(min(count, len(u))):
        best = int(np.argmax(remaining))
        chosen.append(best)
        remaining = lower(u[best])
        remaining[chosen] = -1.0
    return np.array(chosen, dtype=int)
