"""What a person reads of predicted load cases."""

from collections.abc import Mapping
from typing import Any

from cfem.identify.cases.text import repeats_line


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
