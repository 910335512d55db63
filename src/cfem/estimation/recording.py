"""A table of recorded frames: markers, and what was recorded of the actuators."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cfem.condensed import Rows
from cfem.core.errors import InputError
from cfem.dataset.tables import Table, read_table

AXES = "xyz"


@dataclass(frozen=True)
class Recording:
    """f frames. time (f,) s or None; markers (f, m, 3) mm, nan where one was hidden; displacement, force, command
    (f, n_a) mm and N, nan where they were not recorded."""

    time: np.ndarray | None
    markers: np.ndarray
    displacement: np.ndarray
    force: np.ndarray
    command: np.ndarray

    def __len__(self) -> int:
        return len(self.markers)

    @property
    def period(self) -> float | None:
        """s from one frame to the next, the median."""
        return None if self.time is None or len(self) < 2 else float(np.median(np.diff(self.time)))


def read_recording(
    path: Path, markers: Sequence[str], rows: Rows, actuator_units: Sequence[tuple[str, str]], forces: bool = False
) -> Recording:
    """forces: whether commands are. InputError naming the file, the row and the column of what is wrong."""
    units = {"time": "s"} | {f"{name}.{axis}": "mm" for name in markers for axis in AXES}
    for name, (displacement, force) in zip(rows.actuators, actuator_units, strict=True):
        units |= {
            f"{name}.displacement": displacement,
            f"{name}.force": force,
            f"{name}.command": force if forces else displacement,
        }
    table = read_table(path, units)
    columns, count = table.columns, len(table)
    if not count:
        raise InputError("holds no frames", where=str(path), do="add one row per frame")
    absent = next((one for name in markers for axis in AXES if (one := f"{name}.{axis}") not in columns), None)
    if absent is not None:
        raise InputError(f"has no column '{absent} [mm]'", where=str(path), do="record it, or drop the marker")
    places = np.stack([_group(columns, [f"{name}.{axis}" for axis in AXES], count) for name in markers], axis=1)
    driven = (_group(columns, [f"{name}.{what}" for name in rows.actuators], count)
              for what in ("displacement", "force", "command"))  # fmt: skip
    return Recording(_times(table), places, *driven)


def read_truth(path: Path, loaded: Sequence[str], rows: Rows, frames: int) -> dict[str, np.ndarray]:
    """Unknown -> its true value in each frame (f,), of those that the table has. InputError as `read_recording`."""
    names = {f"{name}.force": name for name in loaded} | {f"{name}.displacement": name for name in rows.actuators}
    units = {column: "N" if column.endswith(".force") else "mm" for column in names}
    found = {names[column]: values for column, values in read_table(path, units).columns.items()}
    for name, values in found.items():
        if len(values) != frames:
            what = f"column of '{name}' has {len(values)} rows, the recording {frames} frames"
            raise InputError(what, where=str(path), do="give one row per frame")
    return found


def _group(columns: Mapping[str, np.ndarray], names: Sequence[str], count: int) -> np.ndarray:
    nothing = np.full(count, np.nan)
    return np.stack([columns.get(name, nothing) for name in names], axis=1)


def _times(table: Table) -> np.ndarray | None:
    time = table.columns.get("time")
    if time is None:
        return None
    gaps, back = np.flatnonzero(~np.isfinite(time)), np.flatnonzero(~(np.diff(time) > 0))
    if len(gaps) or len(back):
        row = gaps[0] if len(gaps) else back[0] + 1
        raise InputError("'time' does not increase from frame to frame", where=table.places[row], do="sort the rows")
    return time
