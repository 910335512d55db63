"""The table of load cases: one row for each marker of each case."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cfem.core.errors import InputError, SpecError
from cfem.core.text_table import TextTable, read_rows, titled
from cfem.core.units import parse_quantity
from cfem.identify.cases.spec import TableColumns

_SMALL, _LARGE = 1 / 30, 30.0  # of the robot's length: places beyond are of another unit
_METRE = 1000.0  # between the units that are mistaken for each other, and how near to it a ratio has to be
_NEAR = 3.0
_TRUE, _FALSE = ("1", "1.0", "true", "yes"), ("0", "0.0", "false", "no", "")


@dataclass(frozen=True)
class Cases:
    """Load cases, m of them, with k markers.

    names:      (m,)
    sessions:   (m,), '' where none is stated
    forces:     (m, n_a) N or MPa of the actuators
    directions: (m,) 1 while loading, -1 while unloading
    places:     (m, k, 3) mm, nan where not measured
    rest:       (m, k, 3) mm before the load, None where places themselves are compared
    before:     (m,) forces (j, n_a) that were commanded one after another before, None where the table does not say"""

    names: tuple[str, ...]
    sessions: tuple[str, ...]
    forces: np.ndarray
    directions: np.ndarray
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
        """Places (m, k, 3) mm that a model is compared with, or displacements from rest."""
        return self.places if self.rest is None else self.places - self.rest

    @property
    def largest_change(self) -> float:
        """Largest distance (mm) of a marker from rest or, where places are compared, from its mean over the cases."""
        target = self.target
        if self.rest is None:
            seen = np.isfinite(target)
            target = target - np.where(seen, target, 0.0).sum(axis=0) / np.maximum(seen.sum(axis=0), 1)
        return float(np.nanmax(np.linalg.norm(target, axis=2), initial=0.0))

    @property
    def marks(self) -> list[str]:
        """Hashes (m,) of what was measured, '' where nothing was: a case is recognised by its own."""
        measured = np.isfinite(self.places).any(axis=(1, 2))
        hashes = [hashlib.sha256(places.tobytes()).hexdigest()[:16] for places in self.places]
        return [mark if seen else "" for mark, seen in zip(hashes, measured, strict=True)]

    def only(self, chosen: np.ndarray) -> "Cases":
        """The cases of a mask or of numbers."""
        index = np.arange(len(self))[chosen]
        rest = None if self.rest is None else self.rest[index]
        names, sessions, before = (
            tuple(values[i] for i in index) for values in (self.names, self.sessions, self.before)
        )
        return Cases(names, sessions, self.forces[index], self.directions[index], self.places[index], rest, before)


_Rows = dict[tuple[str, ...], dict[str, int]]  # of each case, the table's row of each marker


def read_cases(
    path: Path,
    layout: TableColumns,
    markers: list[str],
    actuators: list[str],
    units: list[str],
    length: float,
    measured: bool = True,
) -> Cases:
    """The load cases of a table. InputError naming the file, the row and the column of what cannot be read, or is
    hardly meant.

    units:    of each actuator's force
    length:   mm of the robot
    measured: whether places must be there"""
    table = titled(path, [row for row in read_rows(path) if not row.blank])
    if not table.rows:
        raise InputError("holds no load cases", where=str(path), do="add one row per marker and case")
    lacking = [name for name in actuators if name not in layout.forces]
    if lacking:
        what = f"names no column of actuator '{lacking[0]}'"
        raise SpecError(what, where="layout.forces", do=f"give the columns of {', '.join(actuators)}")
    cases = _cases(table, layout)
    _demand_markers(table, cases, markers, measured)
    driving = [layout.forces[name].column for name in actuators]
    position = layout.position if measured or set(layout.position) <= set(table.titles) else []
    # one call: all columns of numbers agree on the decimal mark
    groups = [driving, position, layout.rest or []]
    numbers = table.numbers([table.column(title) for group in groups for title in group])
    values, after_load, before_load = np.split(numbers, np.cumsum([len(group) for group in groups])[:-1], axis=1)
    factors = [_factor(layout, *pair) for pair in zip(actuators, units, strict=True)]
    forces = _forces(table, values, list(cases.values()), driving) * factors
    places = _by_marker(layout.unit * after_load, cases, markers)
    rest = None if layout.rest is None else _by_marker(layout.unit * before_load, cases, markers)
    _demand_one_unit(table, cases, markers, places, layout.position)
    if rest is not None:
        _demand_one_unit(table, cases, markers, rest, layout.rest)
    _demand_size(path, places, length)
    first = [min(case.values()) for case in cases.values()]
    unloading = zip(first, _cells(table, layout.unloading, first), strict=True)
    return Cases(
        names=tuple(" ".join(case) for case in cases),
        sessions=_sessions(table, layout.session, first),
        forces=forces,
        directions=np.array([_direction(table, layout, row, cell) for row, cell in unloading]),
        places=places,
        rest=rest,
        before=_before(_cells(table, layout.history, first), forces),
    )


def _cases(table: TextTable, layout: TableColumns) -> _Rows:
    """The rows of each case. InputError where a marker stands twice in a case."""
    keys = list(zip(*(table.texts(title) for title in layout.case), strict=True))
    cases: _Rows = {}
    for row, (case, marker) in enumerate(zip(keys, table.texts(layout.marker), strict=True)):
        if marker in cases.setdefault(case, {}):
            what = f"marker '{marker}' appears twice in case {' '.join(case)}"
            do = "add the column that tells the two cases apart to layout.case"
            raise InputError(what, where=table.where(row), do=do)
        cases[case][marker] = row
    return cases


def _demand_markers(table: TextTable, cases: _Rows, markers: list[str], measured: bool) -> None:
    """Raises InputError where measured cases lack a marker throughout, where no marker is known, or where some cases
    have an unknown name and lack a marker: it is misspelt. Names that the spec leaves out are otherwise ignored."""
    known = set(markers)
    seen = {name for case in cases.values() for name in case}
    absent = [name for name in markers if name not in seen]
    if absent and (measured or not seen & known):
        what = f"holds no marker '{absent[0]}'; it has {', '.join(sorted(seen))}"
        raise InputError(what, where=str(table.path), do="name the markers as the table does")
    for name in sorted(seen - known):
        inside = [case for case in cases.values() if name in case]
        if len(inside) < len(cases) and all(known - set(case) for case in inside):
            lacked = ", ".join(sorted(known - set(inside[0])))
            what = f"marker '{name}' is none of {', '.join(markers)}, and this case lacks {lacked}"
            raise InputError(what, where=table.where(inside[0][name]), do="name it as `markers` does, or leave it out")


def _factor(layout: TableColumns, actuator: str, unit: str) -> float:
    """The size of the unit of an actuator's column, in `unit`."""
    try:
        return parse_quantity(f"1 {layout.forces[actuator].unit}", unit)
    except ValueError as error:
        raise SpecError(str(error), where=f"layout.forces.{actuator}.unit") from None


def _forces(table: TextTable, values: np.ndarray, cases: list[dict[str, int]], columns: list[str]) -> np.ndarray:
    """Forces (m, n_a) of each case, of `values` (rows, n_a). InputError where rows of a case differ, or none has
    one."""
    forces = np.empty((len(cases), len(columns)))
    for i, case in enumerate(cases):
        rows = sorted(case.values())
        for j, column in enumerate(columns):
            stated = [row for row in rows if not np.isnan(values[row, j])]
            if not stated:
                what = f"column '{column}': is empty, by which the robot was driven"
                raise InputError(what, where=table.where(rows[0]), do="fill in the cell, or leave the row out")
            first = stated[0]
            differing = next((row for row in stated if values[row, j] != values[first, j]), None)
            if differing is not None:
                what = f"column '{column}': is {values[differing, j]:g}, and {values[first, j]:g} in line "
                what += f"{table.rows[first].line} of the same case"
                do = "give a case one force, or tell the cases apart"
                raise InputError(what, where=table.where(differing), do=do)
            forces[i, j] = values[first, j]
    return forces


def _by_marker(values: np.ndarray, cases: _Rows, markers: list[str]) -> np.ndarray:
    """Values (m, k, 3) by case and marker, of values (rows, 3 or 0); nan where a case has no row of a marker."""
    by_marker = np.full((len(cases), len(markers), 3), np.nan)
    for i, case in enumerate(cases.values()):
        for j, marker in enumerate(markers):
            if marker in case and values.shape[1]:
                by_marker[i, j] = values[case[marker]]
    return by_marker


def _cells(table: TextTable, title: str | None, rows: list[int]) -> list[str]:
    """Texts of a column in these rows, empty without a column."""
    if title is None:
        return [""] * len(rows)
    texts = table.texts(title)
    return [texts[row] for row in rows]


def _sessions(table: TextTable, titles: list[str], rows: list[int]) -> tuple[str, ...]:
    """The session of each row, '' without columns of sessions."""
    columns = [_cells(table, title, rows) for title in titles]
    return tuple(" ".join(cells) for cells in zip(*columns, strict=True)) if columns else ("",) * len(rows)


def _direction(table: TextTable, layout: TableColumns, row: int, cell: str) -> float:
    """Direction of loading: 1 while loading, -1 while unloading. InputError where the cell says neither."""
    if cell.lower() not in (*_TRUE, *_FALSE):
        what = f"column '{layout.unloading}': '{cell}' is neither 1 nor 0"
        raise InputError(what, where=table.where(row), do="write 1 where the load had been larger before, else 0")
    return -1.0 if cell.lower() in _TRUE else 1.0


def _before(histories: list[str], forces: np.ndarray) -> tuple[np.ndarray | None, ...]:
    """Forces (j, n_a), for each of m cases, of the cases of the same history above it, None where it has no history."""
    earlier = ([j for j in range(i) if histories[j] == name] for i, name in enumerate(histories))
    return tuple(forces[cases] if name else None for name, cases in zip(histories, earlier, strict=True))


def _demand_one_unit(
    table: TextTable, cases: _Rows, markers: list[str], places: np.ndarray, columns: Sequence[str]
) -> None:
    """Raises InputError where a marker's place is a thousand times nearer to the origin, or farther, than in other
    cases."""
    distance = np.linalg.norm(places, axis=2)
    for j, marker in enumerate(markers):
        usual = float(np.nanmedian(distance[:, j])) if np.isfinite(distance[:, j]).any() else 0.0
        for case, size in zip(cases.values(), distance[:, j], strict=True):
            ratio = max(size, usual) / min(size, usual) if min(size, usual) > 0 else 1.0
            if _METRE / _NEAR < ratio < _METRE * _NEAR:
                what = f"column '{columns[0]}': marker '{marker}' is {size:.3g} mm from the origin, and "
                what += f"{usual:.3g} mm in the middle of all cases: this row is in another unit"
                raise InputError(what, where=table.where(case[marker]), do="write all rows in layout.unit")


def _demand_size(path: Path, places: np.ndarray, length: float) -> None:
    """Raises InputError where the places are far smaller or larger than the robot's length (mm)."""
    if not np.isfinite(places).any():
        return
    reach = float(np.nanmax(np.abs(places)))
    if not _SMALL * length <= reach <= _LARGE * length:
        what = f"places reach {reach:.3g} mm, and the robot is {length:.4g} mm long: the unit is another"
        raise InputError(what, where=str(path), do="state layout.unit, such as '1 m'")
