"""Whether the locked compliance of a trained model is near enough to singular that its sign must be seen to.

What is far from singular at all of many states between the samples pays nothing; any other model has its W made
semidefinite where it is assembled (`cfem.predict.series.semidefinite`), at every state and in every runtime."""

from typing import Any

import numpy as np

from cfem.predict.protocol import Predictor
from cfem.surrogate.definiteness import between

STATES, SEED = 20_000, 1
NEAR = 1e-4  # smallest eigenvalue of C, each row in units of its own compliance, below which the sign is seen to


def locked_compliance(predictor: Predictor, dataset: Any) -> dict[str, Any]:
    """Judgement of the locked compliance. least: the smallest eigenvalue of C, in units of `sizes`, as the model gives
    it between the samples; sizes (n_e,) for `cfem.predict.series.semidefinite`, or None where it is far from
    singular."""
    state = predictor.at(*between(predictor, dataset, STATES, SEED))
    sizes = np.sqrt(np.abs(np.einsum("mii->mi", state.W[:, predictor.rows.e, predictor.rows.e])).mean(axis=0))
    least = float(np.linalg.eigvalsh(state.locked_compliance / np.outer(sizes, sizes))[:, 0].min())
    return {"least": least, "sizes": sizes.tolist() if least < NEAR else None}
