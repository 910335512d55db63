"""Section on whether a model's warning of states outside its domain can be trusted: true error against stated
distance."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from cfem.condensed.parameters import completed
from cfem.core.console.shown import length_unit
from cfem.core.errors import InputError, NumericalError
from cfem.dataset.reader import Dataset
from cfem.predict.protocol import Predictor
from cfem.predict.series.domain import FAR
from cfem.report.chart import Chart, chart, panel
from cfem.report.style import FAINT, LEARNED
from cfem.report.tables import ReportTable, lengths, number, tabulate

FLOOR = 1e-12  # mm: smaller is nothing


@dataclass(frozen=True)
class Trust:
    """Errors of a model at m states of which FE knows the truth, and what the model says of itself there."""

    error: np.ndarray  # (m,) mm of the tip, at the state's own actuator displacements; NaN where the model finds none
    distance: np.ndarray  # (m,) from the training states
    inside: np.ndarray  # (m,) what the model says of itself
    beyond: np.ndarray  # (m,) whether the state is out of the reach that the model was made for


def trust(predictor: Predictor, states: Dataset, beyond: Dataset | None = None) -> Trust:
    """Errors of a model at all of `states`, and at those of `beyond` whose actuators stand outside the model's reach.
    InputError where one of the two is of another robot."""
    parts = [_trust(predictor, states, False)]
    if beyond is not None:
        _demand_same_rows(predictor, beyond)
        low, high = predictor.reach.T
        outside = ((beyond.delta_a < low) | (beyond.delta_a > high)).any(axis=1)
        parts.append(_trust(predictor, beyond.take(outside), True))
    return Trust(*(np.concatenate([getattr(part, name) for part in parts]) for name in Trust.__dataclass_fields__))


def _trust(predictor: Predictor, states: Dataset, beyond: bool) -> Trust:
    """Errors, distances and flags of a model at solved states."""
    _demand_same_rows(predictor, states)
    error, distance, inside = (np.full(len(states), value) for value in (np.nan, np.nan, False))
    for i, p in enumerate(completed(predictor.parameters, states.p)):
        try:
            predicted = predictor.at_displacement(states.delta_a[i], p)
        except NumericalError:  # a model of forces may know none that leads there: it then says so by itself
            continue
        apart = predicted.delta_e - states.delta_e[i]
        error[i] = np.linalg.norm(apart.reshape(-1, 3), axis=1).max()
        distance[i], inside[i] = predictor.distance(predicted, p), predictor.inside(predicted, p)
    return Trust(error, distance, inside, np.full(len(states), beyond))


def _demand_same_rows(predictor: Predictor, states: Dataset) -> None:
    if predictor.rows != states.rows:
        difference = predictor.rows.difference(states.rows, "the robot of the states that judge it")
        raise InputError(f"a model is of another robot: it {difference}")


def trust_summary(judged: Trust) -> dict[str, Any]:
    """Counts and errors (median and largest, mm) of what is flagged and what is not, and Spearman's rank correlation of
    error and distance, None where one of the two does not vary."""
    known = np.isfinite(judged.error)
    return {
        "states": int((~judged.beyond).sum()),
        "flagged": int((~judged.inside & ~judged.beyond).sum()),
        "beyond": int(judged.beyond.sum()),
        "beyond_flagged": int((~judged.inside & judged.beyond).sum()),
        "without_answer": int((~known).sum()),
        "unflagged_mm": _spread(judged.error[known & judged.inside]),
        "flagged_mm": _spread(judged.error[known & ~judged.inside]),
        "rank_correlation": _rank_correlation(judged.distance[known], judged.error[known]),
    }


def _spread(values: np.ndarray) -> dict[str, float] | None:
    return {"median": float(np.median(values)), "max": float(values.max())} if len(values) else None


def _rank_correlation(first: np.ndarray, second: np.ndarray) -> float | None:
    """Rank correlation (Spearman's): the correlation of the ranks, equal values sharing theirs. (scipy.stats takes a
    second to import.)"""
    if len(first) < 3 or np.ptp(first) == 0 or np.ptp(second) == 0:
        return None
    ranks = []
    for values in (first, second):
        _, place, count = np.unique(values, return_inverse=True, return_counts=True)
        ranks.append((np.cumsum(count) - (count - 1) / 2)[place])
    return float(np.corrcoef(ranks)[0, 1])


def trust_table(summaries: Mapping[str, Mapping[str, Any]]) -> ReportTable:
    """Table of `trust_summary`, one model a row."""
    return tabulate(
        summaries.items(),
        {
            "model": lambda row: row[0],
            "test states flagged": lambda row: f"{row[1]['flagged']} of {row[1]['states']}",
            "states out of reach flagged": lambda row: (
                f"{row[1]['beyond_flagged']} of {row[1]['beyond']}" if row[1]["beyond"] else "–"
            ),
            "tip error where not flagged, median / max": lambda row: lengths(row[1]["unflagged_mm"], "median", "max"),
            "tip error where flagged, median / max": lambda row: lengths(row[1]["flagged_mm"], "median", "max"),
            "rank correlation of error and distance": lambda row: number(row[1]["rank_correlation"], 2),
        },
    )


def trust_chart(judged_by_name: Mapping[str, Trust], prefix: str = "") -> Chart:
    """A panel a model: tip error of states that FE solved, against the distance that the model states."""
    axes = []
    for name, judged in judged_by_name.items():
        unit, mm = length_unit(np.nanmax(judged.error, initial=FLOOR))
        axis = panel(f"{name}: true tip error ({unit})", "stated distance from the training states", log="xy")
        for inside in (True, False):
            for beyond in (False, True):
                group = (judged.inside == inside) & (judged.beyond == beyond) & np.isfinite(judged.error)
                meaning = (
                    f"{'state out of reach' if beyond else 'test state'}, {'not flagged' if inside else 'flagged'}"
                )
                look = {"marker": "^" if beyond else "o", "mfc": "none" if beyond else None, "label": meaning}
                colour = LEARNED[0] if inside else LEARNED[3]
                if group.any():
                    distance, error = (
                        np.maximum(judged.distance[group], 1e-2),
                        np.maximum(judged.error[group], FLOOR) / mm,
                    )
                    axis.plot(distance, error, lw=0, ms=4, alpha=0.7, color=colour, **look)
        axis.axvline(FAR, color=FAINT, lw=1.2, ls="--")
        axes.append(axis)
    text = (
        "True error of a model at states solved by FE, against the distance from its training states that the model "
        "gives. It flags states right of the dashed line (red), and those outside the box of its training states. "
        "The flag is useful where red lies above blue."
    )
    return chart(f"{prefix}trust", text, axes)
