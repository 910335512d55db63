"""The robot at rest: the first state that anybody asks a model for, and one that samples hold only by chance."""

from typing import Any

import numpy as np

from cfem.condensed.model_error import model_error_of
from cfem.core.errors import NumericalError
from cfem.predict.load import build
from cfem.predict.series.domain import Domain
from cfem.surrogate.calibration import at_rest, calibrated

TIP, REACTION, COMPLIANCE = 1e-3, 1e-2, 5e-2  # of the length, the largest force, W: errors at rest that are small


def with_rest(meta: dict[str, Any], arrays: dict[str, np.ndarray], training: Any, test: Any) -> dict[str, Any]:
    """Entries of model.json that take the state at rest into the domain. There are none where the robot has a weight or
    loads or has been sampled at rest. Nor are there where the model's error at rest is not small, or is larger than the
    bound that the model would state there.

    meta, arrays: of the model; training, test: cfem.dataset.reader.Dataset"""
    robot = training.meta.get("robot") or {}
    unknown = robot.get("gravity") or robot.get("loads") or training.n_c or meta["parameters"]
    if unknown or "compliance" not in test.meta or not training.delta_a.any(axis=1).all():
        return {}
    zero = np.zeros((1, training.rows.n_a))
    domain = Domain.of(*(np.vstack([known, zero]) for known in (training.delta_a, training.lambda_a)))
    entries = {"domain": domain.to_json(), "untrained_rest": True}
    predictor = build({**meta, **entries}, arrays)
    try:
        stated = model_error_of(calibrated(predictor, test))
        errors, L = ({}, 0.0) if stated is None else at_rest(predictor, test, stated.command)
    except NumericalError:  # no state without force is found
        return {}
    small = {"tip": TIP * predictor.length, "actuators": REACTION, "W": COMPLIANCE}
    holds = all(error <= min(small[name], getattr(stated, name).at(L)) for name, error in errors.items())
    return entries if errors and holds else {}
