"""What a model states of its own error, from test states that no training has seen.

Of n test states in the domain, the error of a further one is, with probability k / (n + 1), not larger than the k-th
smallest (split conformal prediction: Vovk, Gammerman and Shafer, *Algorithmic Learning in a Random World*, 2005; Lei et
al., JASA 113, 2018). It takes no more than that the states were drawn alike. Errors differ by orders between the middle
and the edges of the data. So they are taken relative to L^power, where L says how far the model extrapolates; the
power is the slope of their logarithms, fitted without the state itself, as that would make its error look smaller."""

from typing import Any

import numpy as np

from cfem.condensed import Condensed
from cfem.condensed.model_error import ErrorBound, ModelError
from cfem.condensed.parameters import completed
from cfem.core.errors import NumericalError
from cfem.predict.protocol import Predictor
from cfem.predict.series.state_error import entry_sizes, extrapolation, reaction_sizes

PROBABILITY = 0.95
ENOUGH = 19  # states for this probability
STEEPEST = 8.0  # power
_POWERS = 0.25  # step of powers that are tried
_NOTHING = 1e-9  # of the largest error: smaller ones are of rounding


def calibrated(predictor: Predictor, test: Any) -> dict[str, Any] | None:
    """`ModelError` as plain data, None where no test state (cfem.dataset.reader.Dataset) lies in the domain or is
    answered."""
    command = "force" if (test.meta.get("plan") or {}).get("space") == "force" else "displacement"
    states, answered = answers(predictor, test, command)
    if states is None:
        return None
    errors = state_errors(predictor, states, test.take(answered), command)
    L = extrapolation(predictor, states, completed(predictor.parameters, test.p[answered]))
    known = dict.fromkeys(errors, (0.0, 1.0))
    if predictor.meta.get("untrained_rest"):
        rest_errors, L_rest = at_rest(predictor, test, command)
        known = {name: (error, L_rest) for name, error in rest_errors.items()}
    error = ModelError(
        probability=promised(len(L)),
        states=len(L),
        left_out=len(test) - len(L),
        command=command,
        **{name: bound(values, L, *known[name]) for name, values in errors.items()},
    )
    return error.model_dump(mode="json")


def promised(states: int) -> float:
    """Probability of bounds that are taken from so many test states."""
    return PROBABILITY if states >= ENOUGH else states / (states + 1)


def answers(predictor: Predictor, test: Any, command: str) -> tuple[Condensed | None, np.ndarray]:
    """The model's states for the commands of the test states, those in its domain, and their numbers."""
    ask = predictor.at_force if command == "force" else predictor.at_displacement
    commands = test.lambda_a if command == "force" else test.delta_a
    states, answered = [], []
    for number, (command_row, p) in enumerate(zip(commands, completed(predictor.parameters, test.p), strict=True)):
        try:
            state = ask(command_row, p)
        except NumericalError:  # as whoever asks is told
            continue
        if predictor.inside(state, p):
            states.append(state)
            answered.append(number)
    return (Condensed.batch(states) if states else None), np.array(answered, int)


def state_errors(predictor: Predictor, states: Condensed, test: Any, command: str) -> dict[str, np.ndarray]:
    """Errors (m,) of the model's states by quantity, in the units of `ModelError`."""
    rows, p = predictor.rows, completed(predictor.parameters, test.p)
    points = ~np.array(rows.turns)
    reaction = states.delta_a - test.delta_a if command == "force" else states.lambda_a - test.lambda_a
    return {
        "tip": np.linalg.norm((states.delta_e - test.delta_e)[:, points], axis=1),
        "actuators": (np.abs(reaction) / reaction_sizes(predictor, command, p)).max(axis=1),
        "W": (np.abs(states.W - test.W) / entry_sizes(states.W)).max(axis=(1, 2)),
    }


def at_rest(predictor: Predictor, data: Any, command: str) -> tuple[dict[str, float], np.ndarray]:
    """Errors of the model at rest by quantity, in the units of `ModelError`, and how far it extrapolates there. They
    are known without a sample, as nothing moves and nothing pulls; of W those between actuators are.

    data: states of the same robot (cfem.dataset.reader.Dataset)"""
    zero, points = np.zeros(predictor.rows.n_a), ~np.array(predictor.rows.turns)
    state = predictor.at_force(zero) if command == "force" else predictor.at_displacement(zero)
    reaction = state.delta_a if command == "force" else state.lambda_a
    compliance = np.array(data.meta["compliance"], float)
    errors = {
        "tip": float(np.linalg.norm(state.delta_e[points])),
        "actuators": float((np.abs(reaction) / reaction_sizes(predictor, command)).max()),
        "W": float((np.abs(state.W_aa - compliance) / entry_sizes(compliance)).max()),
    }
    return errors, extrapolation(predictor, state)


def bound(
    errors: np.ndarray, extrapolation: np.ndarray, known: float = 0.0, known_extrapolation: float = 1.0
) -> ErrorBound:
    """Bound from errors (n,) of states at which the model extrapolates by so much (n,), of so large a power that it
    holds for a known error as well, if a power up to `STEEPEST` does."""
    power, without = powers(errors, extrapolation)
    for least in np.arange(0.0, STEEPEST + _POWERS, _POWERS):
        factor = quantile(errors / extrapolation ** np.maximum(without, least))
        stated = ErrorBound(everywhere=quantile(errors), factor=factor, power=float(max(power, least)))
        if stated.at(np.array(known_extrapolation)) >= known:
            break
    return stated


def powers(errors: np.ndarray, extrapolation: np.ndarray) -> tuple[float, np.ndarray]:
    """Slope of the logarithms of errors (n,) over those of the extrapolation, and the slopes (n,) without each."""
    x, y = np.log(extrapolation), np.log(np.maximum(errors, max(_NOTHING * errors.max(), np.finfo(float).tiny)))

    def slope(n: Any, x: Any, y: Any, xx: Any, xy: Any) -> np.ndarray:
        scatter = n * xx - x**2
        known = scatter > 1e-9 * np.maximum(n * xx, 1e-9)
        return np.clip(np.where(known, (n * xy - x * y) / np.where(known, scatter, 1.0), 0.0), 0.0, STEEPEST)

    n, sums = len(x), (x.sum(), y.sum(), (x * x).sum(), (x * y).sum())
    others = (total - mine for total, mine in zip(sums, (x, y, x * x, x * y), strict=True))
    return float(slope(n, *sums)), slope(n - 1, *others)


def quantile(values: np.ndarray) -> float:
    """The smallest that a further value does not exceed with `PROBABILITY`; the largest where there are too few."""
    rank = int(np.ceil(PROBABILITY * (len(values) + 1)))
    return float(np.sort(values)[min(rank, len(values)) - 1])
