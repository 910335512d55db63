"""Text about a calibration by load cases, for a person."""

import math
from collections.abc import Mapping
from typing import Any


def headline(results: Mapping[str, Any], in_fit: float, confidence: float) -> list[str]:
    """A line for each parameter, what cannot be told, errors, intervals, models and repeats.

    results: `case_results`
    in_fit:  mm, mean error over the markers in the fit"""
    lines = [_estimate(name, entry, confidence) for name, entry in results["estimates"].items()] + list(
        results["untold"]
    )
    left_out = results["models"]["kept"]["left_out_mm"]
    beside = "" if left_out is None else f", {left_out:.3g} mm of cases left out of it"
    lines.append(f"errors, mean over markers: {in_fit:.3g} mm in the fit{beside}")
    inside, near = results["left_out_within"]
    if inside is not None and near is not None:
        lines.append(
            f"of left-out cases {100 * inside:.0f} % of coordinates lie within their {100 * confidence:g} % "
            f"intervals, {100 * near:.0f} % of markers within their radius"
        )
    if len(results["models"]) > 1 and results["best"] is not None:
        lines.append(f"of {len(results['models'])} models '{results['best']}' predicts left-out cases best")
    return lines + _average_lines(results.get("average")) + repeats_line(results["repeats_mm"])


def _average_lines(average: Mapping[str, Any] | None) -> list[str]:
    """The line on the average of the models, none where it cannot be told."""
    if average is None or average["left_out_mm"] is None:
        return []
    weights = sorted(average["weights"].items(), key=lambda named: -named[1])
    shares = ", ".join(f"{100 * weight:.0f} % '{name}'" for name, weight in weights[:3])
    more = f" and {len(weights) - 3} more" if len(weights) > 3 else ""
    line = f"their average is {average['left_out_mm']:.3g} mm off at left-out cases, where they differ by"
    return [f"{line} {average['apart_mm']:.2g} mm from it ({shares}{more}); `average: true` in predict.yaml takes it"]


def repeats_line(largest: float | None) -> list[str]:
    """The line on repeats of a load; largest: mm, None where no load was repeated."""
    if largest is None:
        return []
    return [f"repeats of a load differ by {largest:.2g} mm (largest distance of a marker)"]


def shown(value: float, unit: str) -> tuple[float, str]:
    """A number and its unit as a person would read them."""
    if unit == "rad":
        return math.degrees(value), "deg"
    if unit == "t/mm^3":
        return value * 1e12, "kg/m^3"
    if unit == "MPa":
        return value * 1e3, "kPa"
    return value, "" if unit == "1" else unit


def _estimate(name: str, entry: Mapping[str, Any], confidence: float) -> str:
    value, unit = shown(entry["value"], entry["unit"])
    low, high = (shown(end, entry["unit"])[0] for end in entry["interval"])
    return f"{name} {value:.4g}{' ' + unit if unit else ''}, {100 * confidence:g} % interval [{low:.4g}, {high:.4g}]"
