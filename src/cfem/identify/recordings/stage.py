"""`cfem measurements`: recordings of camera systems to cases.csv, which `cfem calibrate-cases` reads."""

from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.artefact.files import write_json
from cfem.core.stage import Command
from cfem.core.text_table import write_rows
from cfem.identify.recordings.spec import MeasurementsSpec

TABLE, RESULT = "cases.csv", "measurements.json"


def _work(folder: Path, spec: MeasurementsSpec, base: Path) -> dict[str, Any]:
    """Results: registration and noise of each recording."""
    from cfem.identify.recordings.exports import read_recording
    from cfem.identify.recordings.reduce import reduce_recording

    actuators = list(dict.fromkeys(name for recorded in spec.recordings for name in recorded.forces))
    groups = [f"{what}{axis}_mm" for what in ("rest_", "", "sd_") for axis in "xyz"]
    titles = ["case", "session", *actuators, "marker", *(groups if spec.rest else groups[3:])]
    rows, accounts, missing = [], [], []
    for recorded in spec.recordings:
        recording = read_recording(base / recorded.file, recorded.unit)
        reduced = reduce_recording(recording, recorded, spec)
        forces = [f"{recorded.forces[name]:g}" if name in recorded.forces else "" for name in actuators]
        for name in spec.markers:
            place = reduced.place(name, reduced.loaded)
            if not np.isfinite(place).all():
                missing.append(f"{name} in {recorded.case}")
            before = [] if reduced.rest is None else reduced.place(name, reduced.rest)
            rows.append([recorded.case, recorded.session, *forces, name, *before, *place, *reduced.noise(name)])
        accounts.append(_account(recorded.case, recording, reduced, spec))
    write_rows(folder / TABLE, titles, rows)
    write_json(folder / RESULT, {"recordings": accounts})
    return {"headline": _headline(accounts, missing, len(spec.markers)), "recordings": accounts}


def _account(case: str, recording: Any, reduced: Any, spec: MeasurementsSpec) -> dict[str, Any]:
    """The account of one recording."""
    frame, loaded = reduced.frame, reduced.loaded
    return {
        "case": case,
        "frames": len(recording.time),
        "rate_hz": recording.rate,
        "labels": {name: recording.labels[i] for name, i in reduced.numbers.items()},
        "settled_s": [float(recording.time[loaded.first]), float(recording.time[loaded.end - 1])],
        "drift_mm": float(np.nanmax(loaded.drift)),
        "noise_mm": {name: reduced.noise(name).tolist() for name in spec.markers if name in reduced.numbers},
        "registration_mm": frame.residual,
        "turn_sd_deg": np.degrees(frame.turn_sd).tolist(),
        "shift_sd_mm": frame.shift_sd.tolist(),
    }


def _headline(accounts: list[dict[str, Any]], missing: list[str], markers: int) -> list[str]:
    """Lines on the recordings, the fit of their frames, hidden markers, and markers that were named by their places.

    missing: markers and cases; markers: their number"""
    worst = max(account["registration_mm"] for account in accounts)
    noise = max(float(np.nanmax(list(account["noise_mm"].values()))) for account in accounts)
    lines = [
        f"{len(accounts)} recordings, {markers} markers, in {TABLE}",
        f"frames aligned to {worst:.2g} mm or better (root mean square); noise up to {noise:.2g} mm",
    ]
    if missing:
        lines.append(f"markers hidden in some frames: {', '.join(missing)}")
    labels = [item for account in accounts for item in account["labels"].items()]
    renamed = sorted({f"{label} is {name}" for name, label in labels if not label.lower().endswith(name.lower())})
    if renamed:
        lines.append(f"markers named by their places: {', '.join(renamed)}")
    return lines


COMMAND = Command(
    "measurements",
    1,
    MeasurementsSpec,
    _work,
    reads=lambda spec, base: {f"recording {i + 1}": base / asked.file for i, asked in enumerate(spec.recordings)},
)
run, stage = COMMAND.run, COMMAND.stage
