"""The table of load cases: one row for each marker of each case."""

import csv
import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cfem.cases.spec import Layout
from cfem.core.errors import InputError, SpecError
from cfem.core.semicolons import read_rows
from cfem.core.units import parse_quantity

_SMALL, _LARGE = 1 / 30, 30.0  # of the robot's length: places beyond are of another unit


@dataclass(frozen=True)
class Cases:
    """m cases of k markers. names (m,); sessions (m,), '' where none is told; forces (m, n_a) N or MPa of the
    actuators; ways (m,): 1 while loading, -1 while unloading; places (m, k, 3) mm, nan where not measured; rest (m, k,
    3) mm before the load, None where places themselves are compared; before (m,): forces (j, n_a) that were commanded
    one after another before, None where nobody tells."""

    names: tuple[str, ...]
    sessions: tuple[str, ...]
    forces: np.ndarray
    ways: np.ndarray
    places: np.ndarray
    rest: np.ndarray | None
    before: tuple[np.ndarray | None, ...] = ()

    def __post_init__(self):
        if not self.before:
            object.__setattr__(self, "before", (None,) * len(self.names))

    def __len__(self) -> int:
        return len(self.names)

    @property
    def target(self) -> np.ndarray:
        """(m, k, 3) what a model has to meet: places, or displacements from rest."""
        return self.places if self.rest is None else self.places - self.rest

    @property
    def marks(self) -> list[str]:
        """(m,) by which each case is known again: of what was measured, '' where nothing was."""
        numbers = [one if np.isfinite(one).any() else None for one in self.places]
        return ["" if one is None else hashlib.sha256(one.tobytes()).hexdigest()[:16] for one in numbers]

    def only(self, chosen: np.ndarray) -> "Cases":
        """Those of a mask or of numbers."""
        index = np.arange(len(self))[chosen]
        rest = None if self.rest is None else self.rest[index]
        names, sessions = (tuple(one[i] for i in index) for one in (self.names, self.sessions))
        before = tuple(self.before[i] for i in index)
        return Cases(names, sessions, self.forces[index], self.ways[index], self.places[index], rest, before)


def read_cases(
    path: Path,
    layout: Layout,
    markers: list[str],
    actuators: list[str],
    units: list[str],
    length: float,
    measured: bool = True,
) -> Cases:
    """units: of each actuator's force; length: mm of the robot; measured: whether places must be there. InputError
    naming the file, the row and the column of what cannot be read, or is hardly meant."""
    rows = _rows(path)
    missing_force = [name for name in actuators if name not in layout.forces]
    if missing_force:
        what = f"names no column of actuator '{missing_force[0]}'"
        raise SpecError(what, where="layout.forces", do=f"give the columns of {', '.join(actuators)}")
    needed = [*layout.case, layout.marker, *(one.column for one in layout.forces.values())]
    needed += [one for one in (layout.session, layout.history) if one is not None]
    needed += layout.position if measured else []
    for name in needed:
        if name not in rows[0]:
            what = f"has no column '{name}', only {', '.join(rows[0])}"
            raise InputError(what, where=str(path), do="compare the table with `layout`")
    found: dict[tuple[str, ...], dict[str, int]] = {}
    for number, row in enumerate(rows):
        case, marker = tuple(row[name] for name in layout.case), row[layout.marker]
        if marker in found.setdefault(case, {}):
            what = f"row {number + 2}: marker '{marker}' appears twice in case {' '.join(case)}"
            raise InputError(what, where=str(path), do="add the column that tells the two cases apart to layout.case")
        found[case][marker] = number
    if not any(marker in case for case in found.values() for marker in markers):
        seen = sorted({row[layout.marker] for row in rows})
        what = f"holds none of the markers {', '.join(markers)}; it has {', '.join(seen)}"
        raise InputError(what, where=str(path), do="name the markers as the table does")
    forces = np.array(
        [
            [_force(path, rows, min(case.values()), layout, *pair) for pair in zip(actuators, units, strict=True)]
            for case in found.values()
        ]
    )
    places = _places(path, rows, found, markers, layout.position, layout.unit)
    rest = None if layout.rest is None else _places(path, rows, found, markers, layout.rest, layout.unit)
    _demand_size(path, places, length)
    first = [rows[min(case.values())] for case in found.values()]
    ways = np.array([_way(row, layout) for row in first])
    sessions = tuple("" if layout.session is None else row[layout.session] for row in first)
    before = _before(["" if layout.history is None else row[layout.history].strip() for row in first], forces)
    return Cases(tuple(" ".join(case) for case in found), sessions, forces, ways, places, rest, before)


def _rows(path: Path) -> list[dict[str, str]]:
    if not path.exists():
        raise InputError("no such file", where=str(path), do="check the path")
    try:
        with open(path, newline="", encoding="utf-8-sig") as file:
            header, *records = [record for record in read_rows(file) if record] or [[]]
    except (UnicodeDecodeError, csv.Error):
        raise InputError(
            "is not a table of comma-separated values", where=str(path), do="save it as CSV in UTF-8"
        ) from None
    if not records:
        raise InputError("holds no load cases", where=str(path), do="add one row per marker and case")
    short = next((number for number, record in enumerate(records) if len(record) != len(header)), None)
    if short is not None:
        what = f"row {short + 2} has {len(records[short])} cells, the header {len(header)}"
        raise InputError(what, where=str(path), do="numbers with a decimal comma need semicolons between cells")
    return [dict(zip(header, record, strict=True)) for record in records]


def _number(path: Path, row: dict[str, str], number: int, column: str) -> float:
    text = row.get(column, "").strip()
    if not text:
        return np.nan
    try:
        value = float(text)
    except ValueError:
        what = f"row {number + 2}, column '{column}': '{text}' is not a number"
        raise InputError(what, where=str(path)) from None
    return value if np.isfinite(value) else np.nan


def _force(path: Path, rows: list, number: int, layout: Layout, actuator: str, unit: str) -> float:
    column = layout.forces[actuator]
    value = _number(path, rows[number], number, column.column)
    if np.isnan(value):
        what = f"row {number + 2} has no '{column.column}', by which the robot was driven"
        raise InputError(what, where=str(path), do="fill in the cell, or leave the row out")
    try:
        return parse_quantity(f"{value!r} {column.unit}", unit)
    except ValueError as error:
        raise SpecError(str(error), where=f"layout.forces.{actuator}.unit") from None


def _way(row: dict[str, str], layout: Layout) -> float:
    return -1.0 if layout.unloading and row.get(layout.unloading, "").strip() in ("1", "true", "yes") else 1.0


def _before(histories: list[str], forces: np.ndarray) -> tuple[np.ndarray | None, ...]:
    earlier = ([j for j in range(i) if histories[j] == one] for i, one in enumerate(histories))
    return tuple(forces[js] if one else None for one, js in zip(histories, earlier, strict=True))


def _places(path: Path, rows: list, found: dict, markers: list[str], columns: list[str], unit: float) -> np.ndarray:
    places = np.full((len(found), len(markers), 3), np.nan)
    for i, case in enumerate(found.values()):
        for j, marker in enumerate(markers):
            if marker in case:
                number = case[marker]
                places[i, j] = [unit * _number(path, rows[number], number, column) for column in columns]
    return places


def _demand_size(path: Path, places: np.ndarray, length: float) -> None:
    if not np.isfinite(places).any():
        return
    reach = float(np.nanmax(np.abs(places)))
    if not _SMALL * length <= reach <= _LARGE * length:
        what = f"places reach {reach:.3g} mm, and the robot is {length:.4g} mm long: the unit is another"
        raise InputError(what, where=str(path), do="state layout.unit, such as '1 m'")
