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


def repeats(cases: Cases) -> dict[str, float]:
    """mm, of each case that has others of the same forces: largest distance of a marker from where it is in these."""
    largest: dict[str, float] = {}
    for i in range(len(cases)):
        for j in range(len(cases)):
            alike = np.allclose(cases.forces[i], cases.forces[j]) and cases.ways[i] == cases.ways[j]
            apart = np.linalg.norm(cases.target[i] - cases.target[j], axis=1)
            if i != j and alike and np.isfinite(apart).any():
                largest[cases.names[i]] = max(largest.get(cases.names[i], 0.0), float(np.nanmax(apart)))
    return largest
