"""A table of recorded frames: markers, and what was recorded of the actuators."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cfem.condensed import Rows
from cfem.core.errors import InputError
from cfem.dataset.tables import Table, read_table
from cfem.identify.columns import Driven, actuator_columns

AXES = "xyz"


@dataclass(frozen=True)
class Recording:
    """A recording of f frames of m markers and n_a actuators, nan where a marker was hidden or a quantity was not
    recorded.

    time:         (f,) s, None where it was not recorded
    markers:      (f, m, 3) mm
    displacement: (f, n_a) mm
    force:        (f, n_a) N
    command:      (f, n_a) mm or N"""

    time: np.ndarray | None
    markers: np.ndarray
    displacement: np.ndarray
    force: np.ndarray
    command: np.ndarray

    def __len__(self) -> int:
        return len(self.markers)

    @property
    def period(self) -> float | None:
        """Median time (s) from one frame to the next, None where it was not recorded."""
        return None if self.time is None or len(self) < 2 else float(np.median(np.diff(self.time)))


def read_frames(
    path: Path,
    markers: Sequence[str],
    rows: Rows,
    actuator_units: Sequence[tuple[str, str]],
    command: Driven = "displacement",
) -> Recording:
    """The recording in a table. InputError naming the file, the row and the column of what is wrong.

    actuator_units: of each actuator's displacement and force
    command:        what commands state"""
    axes = [f"{name}.{axis}" for name in markers for axis in AXES]
    units = {"time": "s"} | dict.fromkeys(axes, "mm") | actuator_columns(rows.actuators, actuator_units, command)
    table = read_table(path, units)
    if not len(table):
        raise InputError("holds no frames", where=str(path), do="add one row per frame")
    absent = next((axis for axis in axes if axis not in table.columns), None)
    if absent is not None:
        raise InputError(f"has no column '{absent} [mm]'", where=str(path), do="record it, or drop the marker")
    displacement, force, commanded = (
        table.stack([f"{name}.{quantity}" for name in rows.actuators])
        for quantity in ("displacement", "force", "command")
    )
    places = table.stack(axes).reshape(len(table), len(markers), 3)
    return Recording(_times(table), places, displacement, force, commanded)


def read_truth(path: Path, loaded: Sequence[str], rows: Rows, frames: int) -> dict[str, np.ndarray]:
    """True value of each unknown in each frame (f,), of those that the table has. InputError as `read_frames`."""
    names = {f"{name}.force": name for name in loaded} | {f"{name}.displacement": name for name in rows.actuators}
    units = {column: "N" if column.endswith(".force") else "mm" for column in names}
    truth = {names[column]: values for column, values in read_table(path, units).columns.items()}
    for name, values in truth.items():
        if len(values) != frames:
            what = f"column of '{name}' has {len(values)} rows, the recording {frames} frames"
            raise InputError(what, where=str(path), do="give one row per frame")
    return truth


def _times(table: Table) -> np.ndarray | None:
    """Times (f,) s, None without a column of times. InputError where time does not increase."""
    time = table.columns.get("time")
    if time is None:
        return None
    gaps, back = np.flatnonzero(~np.isfinite(time)), np.flatnonzero(~(np.diff(time) > 0))
    if len(gaps) or len(back):
        row = gaps[0] if len(gaps) else back[0] + 1
        raise InputError(
            "'time' does not increase from frame to frame",
            where=table.places[row],
            do="sort the rows, and keep one of those with the same time",
        )
    return time
