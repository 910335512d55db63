"""Places for trial markers on a surface."""

import numpy as np

from cfem.predict.protocol import Predictor


def markers_near(model: Predictor, count: int) -> np.ndarray:
    """(count, 3) mm nodes of the surface spread over what moves: for trials."""
    rest = model.skin.rest
    moves = np.linalg.norm(model.skin.modes, axis=(0, 2))
    loose = np.flatnonzero(moves > 0.2 * moves.max())
    chosen = [int(loose[np.argmax(np.linalg.norm(rest[loose] - rest[loose].mean(axis=0), axis=1))])]
    while len(chosen) < count:
        apart = np.linalg.norm(rest[loose][:, None] - rest[chosen], axis=2).min(axis=1)
        chosen.append(int(loose[np.argmax(apart)]))
    return rest[chosen]
