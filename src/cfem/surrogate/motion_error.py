"""What a model states of the error of its natural frequencies, from test states that no training has seen.

Finite elements gave theirs at these states (`frequencies: true` in sample.yaml). Bounds are made of the errors as of
the model at rest (`calibration`)."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cfem.core.errors import NumericalError
from cfem.motion.error import FrequencyError
from cfem.motion.model import MotionModel
from cfem.motion.modes import natural_modes
from cfem.predict.series.state_error import extrapolation
from cfem.surrogate.calibration import answers, bound, promised


def calibrated_frequencies(
    model: MotionModel, test: Any, sampled: Mapping[str, Sequence[Sequence[float] | None]]
) -> dict[str, Any] | None:
    """`FrequencyError` as plain data, None where no test state (cfem.dataset.reader.Dataset) lies in the domain and is
    stable. sampled: of finite elements, Hz by `held` and `free`, at each test state; None where it is unstable"""
    states, answered = answers(model.static, test, "displacement")
    if states is None or model.n_r == 0:
        return None
    L = extrapolation(model.static, states)
    errors = frequency_errors(model, test.delta_a, sampled)[answered]
    stable = np.isfinite(errors).all(axis=(1, 2))
    if not stable.any():
        return None
    L = L[stable]
    held, free = (tuple(bound(mode, L) for mode in kind.T) for kind in errors[stable].swapaxes(0, 1))
    error = FrequencyError(
        probability=promised(len(L)),
        states=len(L),
        left_out=len(test) - len(L),
        held=held,
        free=free,
    )
    return error.model_dump(mode="json")


def frequency_errors(
    model: MotionModel, delta_a: np.ndarray, sampled: Mapping[str, Sequence[Sequence[float] | None]]
) -> np.ndarray:
    """Relative errors (m, 2, k) of the lowest frequencies at states (m, n_a), with the actuators held and free; NaN
    where the robot is unstable."""
    count = _modes(model, sampled)
    errors = np.full((len(delta_a), 2, count), np.nan)
    for column, kind in enumerate(("held", "free")):
        for row, (delta, true) in enumerate(zip(delta_a, sampled[kind], strict=True)):
            try:
                learned = natural_modes(model, delta, kind == "held", count).frequency
            except NumericalError:
                continue
            if true is not None:
                errors[row, column] = np.abs(learned / np.array(true[:count]) - 1)
    return errors


def _modes(model: MotionModel, sampled: Mapping[str, Sequence[Sequence[float] | None]]) -> int:
    """Number of frequencies that the model and finite elements both have."""
    return min(model.n_r, *(len(true) for true in sampled["held"] if true is not None))
