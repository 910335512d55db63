"""Predictions as a table, and what repeats of a load tell of its own scatter."""

import csv
import io
from pathlib import Path

import numpy as np

from cfem.cases.intervals import LeftOut
from cfem.cases.predict import Prediction
from cfem.cases.table import Cases
from cfem.core.files import write_whole


def write_predictions(
    path: Path, cases: Cases, markers: list[str], found: Prediction, left: LeftOut | None = None
) -> None:
    """A row a case and marker, in mm: predicted place (or displacement), half of the interval of each coordinate,
    radius within which the marker lies, and where it was measured its error, signed and as a distance."""
    what = "place" if cases.rest is None else "displacement"
    header = ["case", "session", "marker"]
    header += [f"{what}_{a}_mm" for a in "xyz"] + [f"half_{a}_mm" for a in "xyz"] + ["radius_mm"]
    header += [f"error_{a}_mm" for a in "xyz"] + ["distance_mm"]
    header += ["left_out_distance_mm"] if left is not None else []
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(header)
    for i, (case, session) in enumerate(zip(cases.names, cases.sessions, strict=True)):
        for j, marker in enumerate(markers):
            numbers = [*found.y[i, j], *found.half[i, j], found.radius[i, j], *found.error[i, j], found.distance[i, j]]
            numbers += [left.distance[i, j]] if left is not None else []
            table.writerow([case, session, marker, *("" if np.isnan(n) else f"{n:.4f}" for n in numbers)])
    write_whole(path, text.getvalue().encode())


def repeats(cases: Cases) -> float | None:
    """mm: largest distance of a marker between two cases of the same forces, None where there are no two."""
    largest = []
    for i in range(len(cases)):
        for j in range(i):
            if np.allclose(cases.forces[i], cases.forces[j]) and cases.ways[i] == cases.ways[j]:
                apart = np.linalg.norm(cases.target[i] - cases.target[j], axis=1)
                largest.append(np.nanmax(apart) if np.isfinite(apart).any() else 0.0)
    return float(max(largest)) if largest else None
