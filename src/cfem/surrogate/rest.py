"""The robot at rest: the first state that anybody asks a model for, and one that samples hold only by chance."""

from typing import Any

import numpy as np

from cfem.predict.protocol import Predictor
from cfem.predict.series.domain import Domain
from cfem.surrogate.error_measures import state

TIP, FORCE = 1e-4, 1e-3  # of the length, of the largest force: errors at rest that are small enough in any case


def domain_with_rest(predictor: Predictor, training: Any, errors: dict[str, Any]) -> dict[str, Any] | None:
    """The domain of the training states and the state at rest, as plain data. None where this is none without force
    and displacement, or the model errs there by more than in the worst test state and by more than `TIP` or `FORCE`.

    training: cfem.dataset.reader.Dataset; errors: of `measure`"""
    robot, rows = training.meta.get("robot") or {}, training.rows
    if robot.get("gravity") or robot.get("loads") or training.n_c or predictor.parameters:
        return None
    zero = np.zeros((1, rows.n_a))
    lambda_a, delta_e = state(rows, *predictor.evaluate(zero, np.zeros((1, 0))), zero)
    tip, force = np.linalg.norm(delta_e.reshape(-1, 3), axis=1).max(), np.abs(lambda_a).max()
    small = TIP * float(training.meta["length"]), FORCE * np.abs(training.lambda_a).max()
    if tip > max(errors["tip_mm"]["max"], small[0]) or force > max(errors["force_N"]["max"], small[1]):
        return None
    known = (np.vstack([told, zero]) for told in (training.delta_a, training.lambda_a))
    return Domain.of(*known).to_json()
