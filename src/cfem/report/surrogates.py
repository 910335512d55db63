"""What trained models say of themselves, and whether their warning of being outside their domain can be trusted."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.errors import InputError, NumericalError
from cfem.dataset.reader import Dataset
from cfem.predict.protocol import Predictor


@dataclass(frozen=True)
class Trust:
    """Of m states of which FE knows the truth: error (m,) mm of the model's tip at the state's own actuator
    displacements, NaN where the model finds none; distance (m,) from its training states; inside (m,) what the model
    says of itself; beyond (m,) whether the state is out of the reach that the model was made for."""

    error: np.ndarray
    distance: np.ndarray
    inside: np.ndarray
    beyond: np.ndarray


def trained(results: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Results of a train folder; InputError where it is of another stage or of a version that measured less."""
    complete = all("seconds_sampling" in point for point in results.get("learning_curve", [{}]))
    if not complete or "share" not in results.get("positive_definite", {}):
        raise InputError("holds no model that this version trained", where=str(folder), do="run cfem train on it")
    return dict(results)


def trust(predictor: Predictor, states: Dataset, beyond: Dataset | None = None) -> Trust:
    """At every state of `states`, and at those of `beyond` whose actuators stand outside the model's reach. InputError
    where one of the two is of another robot."""
    parts = [_trust(predictor, states, False)]
    if beyond is not None:
        _demand_same_rows(predictor, beyond)
        low, high = predictor.reach.T
        outside = ((beyond.delta_a < low) | (beyond.delta_a > high)).any(axis=1)
        parts.append(_trust(predictor, beyond.take(outside), True))
    return Trust(*(np.concatenate([getattr(part, name) for part in parts]) for name in Trust.__dataclass_fields__))


def _trust(predictor: Predictor, states: Dataset, beyond: bool) -> Trust:
    from cfem.surrogate.stage import all_parameters

    _demand_same_rows(predictor, states)
    error, distance, inside = (np.full(len(states), value) for value in (np.nan, np.nan, False))
    for i, p in enumerate(all_parameters(predictor, states)):
        try:
            found = predictor.at_displacement(states.delta_a[i], p)
        except NumericalError:  # a model of forces may know none that leads there: it then says so by itself
            continue
        apart = found.delta_e - states.delta_e[i]
        error[i] = np.linalg.norm(apart.reshape(-1, 3), axis=1).max()
        distance[i], inside[i] = predictor.distance(found, p), predictor.inside(found, p)
    return Trust(error, distance, inside, np.full(len(states), beyond))


def _demand_same_rows(predictor: Predictor, states: Dataset) -> None:
    if predictor.rows != states.rows:
        raise InputError(f"a model has rows {predictor.rows.names}, the states that judge it {states.rows.names}")


def trust_summary(found: Trust) -> dict[str, Any]:
    """Counts, errors (median and largest, mm) of what is flagged and what is not, and Spearman's rank correlation of
    error and distance, None where one of the two does not vary."""
    known = np.isfinite(found.error)
    return {
        "states": int((~found.beyond).sum()),
        "flagged": int((~found.inside & ~found.beyond).sum()),
        "beyond": int(found.beyond.sum()),
        "beyond_flagged": int((~found.inside & found.beyond).sum()),
        "without_answer": int((~known).sum()),
        "unflagged_mm": _spread(found.error[known & found.inside]),
        "flagged_mm": _spread(found.error[known & ~found.inside]),
        "rank_correlation": _rank_correlation(found.distance[known], found.error[known]),
    }


def _spread(values: np.ndarray) -> dict[str, float] | None:
    return {"median": float(np.median(values)), "max": float(values.max())} if len(values) else None


def _rank_correlation(one: np.ndarray, other: np.ndarray) -> float | None:
    from scipy.stats import spearmanr

    if len(one) < 3 or np.ptp(one) == 0 or np.ptp(other) == 0:
        return None
    return float(spearmanr(one, other).statistic)
