"""Predictions of load cases as plain data, and whether to trust them."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cfem.core.artefact.judgement import poor
from cfem.identify.cases.outcome import Calibrated
from cfem.identify.cases.prediction.predict import Prediction, beyond_calibration
from cfem.identify.cases.prediction.table import repeats
from cfem.identify.cases.table import Cases
from cfem.identify.cases.text import repeats_line


def prediction_results(
    prediction: Prediction, cases: Cases, markers: Sequence[str], known: Calibrated
) -> dict[str, Any]:
    """Number of cases, half of the median interval, failures and, where cases were measured, errors."""
    beyond = [cases.names[i] for i in np.flatnonzero(beyond_calibration(cases, known))]
    results: dict[str, Any] = {
        "cases": len(cases),
        "median_half_mm": float(np.nanmedian(prediction.half)),
        "failed": {cases.names[i]: why for i, why in prediction.failed.items()},
        "in_fit": sum(bool(mark) and mark in known.given for mark in cases.marks),
    }
    if beyond:
        what = f"{len(beyond)} of {len(cases)} cases are of larger forces than the calibration, the first {beyond[0]}"
        results["judgement"] = [poor(f"{what}: their intervals hold a guess of what the model lacks there")]
    return results | (_errors(prediction, cases, markers) if np.isfinite(prediction.distance).any() else {})


def _errors(prediction: Prediction, cases: Cases, markers: Sequence[str]) -> dict[str, Any]:
    """Errors (mm) by marker and case, and shares within the intervals."""
    distance = prediction.distance
    coordinates, near = prediction.covered()
    return {
        "mean_mm": float(np.nanmean(distance)),
        "largest_mm": float(np.nanmax(distance)),
        "by_marker_mm": {name: _mean(distance[:, j]) for j, name in enumerate(markers)},
        "by_case_mm": {name: _mean(distance[i]) for i, name in enumerate(cases.names)},
        "coordinates_within": coordinates,
        "markers_within": near,
        "repeats_mm": max(repeats(cases).values(), default=None),
    }


def _mean(distance: np.ndarray) -> float | None:
    return float(np.nanmean(distance)) if np.isfinite(distance).any() else None


def headline(results: Mapping[str, Any], measured: int, confidence: float, table: str) -> list[str]:
    """Cases of the calibration and failed ones first, then the intervals, then errors where cases were measured.

    results:  `prediction_results`
    measured: number of markers that were
    table:    name of the file of predictions"""
    count, failed = results["cases"], results["failed"]
    lines = []
    if results["in_fit"]:
        lines.append(
            f"{results['in_fit']} of {count} cases are of the calibration: their errors are not those of predictions"
        )
    if failed:
        name, why = next(iter(failed.items()))
        lines.append(f"{len(failed)} of {count} cases have no equilibrium; the first, {name}: {why}")
    lines.append(
        f"{count} cases predicted; half of the median interval is {results['median_half_mm']:.3g} mm, in {table}"
    )
    if not measured:
        return lines
    percent = f"{100 * confidence:g} %"
    return [
        *lines,
        f"error {results['mean_mm']:.3g} mm, mean over {measured} markers; largest {results['largest_mm']:.3g} mm",
        f"{100 * results['coordinates_within']:.0f} % of coordinates lie within their {percent} intervals, "
        f"{100 * results['markers_within']:.0f} % of markers within their {percent} radius",
        *repeats_line(results["repeats_mm"]),
    ]
