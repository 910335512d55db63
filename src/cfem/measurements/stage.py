"""`cfem measurements`: recordings of camera systems to cases.csv, which `cfem calibrate-cases` reads."""

import csv
import io
from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.files import write_json, write_whole
from cfem.core.stage import Command
from cfem.measurements.spec import MeasurementsSpec

TABLE, RESULT = "cases.csv", "measurements.json"


def _work(folder: Path, spec: MeasurementsSpec, base: Path) -> dict[str, Any]:
    """Results: registration and noise of each recording."""
    from cfem.measurements.exports import read_recording
    from cfem.measurements.reduce import reduce_recording

    actuators = list(dict.fromkeys(name for one in spec.recordings for name in one.forces))
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    groups = [f"{what}{a}_mm" for what in ("rest_", "", "sd_") for a in "xyz"]
    table.writerow(["case", "session", *actuators, "marker", *(groups if spec.rest else groups[3:])])
    recordings, headline, noisiest, missing = [], [], 0.0, []
    for asked in spec.recordings:
        recording = read_recording(base / asked.file, asked.unit)
        found = reduce_recording(recording, asked, spec)
        forces = [f"{asked.forces[name]:g}" if name in asked.forces else "" for name in actuators]
        for name in spec.markers:
            place = found.place(name, found.loaded)
            if not np.isfinite(place).all():
                missing.append(f"{name} in {asked.case}")
            numbers = [*place, *found.noise(name)]
            if found.rest is not None:
                numbers = [*found.place(name, found.rest), *numbers]
            cells = ["" if np.isnan(number) else f"{number:.4f}" for number in numbers]
            table.writerow([asked.case, asked.session, *forces, name, *cells])
        sd = np.array([found.noise(name) for name in spec.markers])
        noisiest = max(noisiest, float(np.nanmax(sd)))
        recordings.append(_account(asked.case, recording, found, spec))
    write_whole(folder / TABLE, text.getvalue().encode())
    worst = max(one["registration_mm"] for one in recordings)
    headline.append(f"{len(recordings)} recordings, {len(spec.markers)} markers, in {TABLE}")
    headline.append(f"frames aligned to {worst:.2g} mm or better (root mean square); noise up to {noisiest:.2g} mm")
    if missing:
        headline.append(f"markers hidden in some frames: {', '.join(missing)}")
    renamed = sorted({f"{label} is {name}" for one in recordings for name, label in one["labels"].items()
                      if not label.lower().endswith(name.lower())})  # fmt: skip
    if renamed:
        headline.append(f"markers named by their places: {', '.join(renamed)}")
    write_json(folder / RESULT, {"recordings": recordings})
    return {"headline": headline, "recordings": recordings}


def _account(case: str, recording: Any, found: Any, spec: MeasurementsSpec) -> dict[str, Any]:
    """What was made of one recording."""
    frame = found.frame
    return {
        "case": case,
        "frames": len(recording.time),
        "rate_hz": recording.rate,
        "labels": {name: recording.labels[i] for name, i in found.numbers.items()},
        "settled_s": [float(recording.time[found.loaded.first]), float(recording.time[found.loaded.end - 1])],
        "drift_mm": float(np.nanmax(found.loaded.drift)),
        "noise_mm": {name: [float(n) for n in found.noise(name)] for name in spec.markers if name in found.numbers},
        "registration_mm": frame.residual,
        "turn_sd_deg": [float(n) for n in np.degrees(frame.turn_sd)],
        "shift_sd_mm": [float(n) for n in frame.shift_sd],
    }


COMMAND = Command(
    "measurements",
    1,
    MeasurementsSpec,
    _work,
    reads=lambda spec, base: {f"recording {i + 1}": base / one.file for i, one in enumerate(spec.recordings)},
)
run, stage = COMMAND.run, COMMAND.stage
