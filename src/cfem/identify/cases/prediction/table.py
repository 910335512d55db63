"""Predictions as a table, and how repeats of a load differ."""

from pathlib import Path

import numpy as np

from cfem.core.text_table import write_rows
from cfem.identify.cases.left_out import LeftOut
from cfem.identify.cases.prediction.predict import Prediction
from cfem.identify.cases.table import Cases


def write_predictions(
    path: Path, cases: Cases, markers: list[str], prediction: Prediction, left_out: LeftOut | None = None
) -> None:
    """Writes a row a case and marker, in mm: predicted place (or displacement), half of the interval of each
    coordinate, radius within which the marker lies, and where it was measured its error, signed and as a distance."""
    what = "place" if cases.rest is None else "displacement"
    header = ["case", "session", "marker"]
    header += [f"{what}_{a}_mm" for a in "xyz"] + [f"half_{a}_mm" for a in "xyz"] + ["radius_mm"]
    header += [f"error_{a}_mm" for a in "xyz"] + ["distance_mm"]
    columns = [prediction.y, prediction.half, prediction.radius[..., None], prediction.error]
    columns += [prediction.distance[..., None]]
    if left_out is not None:
        header.append("left_out_distance_mm")
        columns.append(left_out.distance[..., None])
    numbers = np.concatenate(columns, axis=2)
    rows = [
        [case, session, marker, *numbers[i, j]]
        for i, (case, session) in enumerate(zip(cases.names, cases.sessions, strict=True))
        for j, marker in enumerate(markers)
    ]
    write_rows(path, header, rows)


def repeats(cases: Cases) -> dict[str, float]:
    """Largest distance (mm) of a marker from where it is in other cases of the same forces, of each case that has
    such."""
    largest: dict[str, float] = {}
    for i in range(len(cases)):
        for j in range(len(cases)):
            alike = np.allclose(cases.forces[i], cases.forces[j]) and cases.directions[i] == cases.directions[j]
            distances = np.linalg.norm(cases.target[i] - cases.target[j], axis=1)
            if i != j and alike and np.isfinite(distances).any():
                largest[cases.names[i]] = max(largest.get(cases.names[i], 0.0), float(np.nanmax(distances)))
    return largest
