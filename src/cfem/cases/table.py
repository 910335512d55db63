"""The table of load cases: one row for each marker of each case."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cfem.cases.spec import Layout
from cfem.core.errors import InputError, SpecError
from cfem.core.text_table import TextTable, read_rows, titled
from cfem.core.units import parse_quantity

_SMALL, _LARGE = 1 / 30, 30.0  # of the robot's length: places beyond are of another unit
_METRE = 1000.0  # between the units that are mistaken for each other, and how near to it a ratio has to be
_NEAR = 3.0
_TRUE, _FALSE = ("1", "1.0", "true", "yes"), ("0", "0.0", "false", "no", "")


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
    table = titled(path, [row for row in read_rows(path) if not row.blank])
    if not table.rows:
        raise InputError("holds no load cases", where=str(path), do="add one row per marker and case")
    lacking = [name for name in actuators if name not in layout.forces]
    if lacking:
        what = f"names no column of actuator '{lacking[0]}'"
        raise SpecError(what, where="layout.forces", do=f"give the columns of {', '.join(actuators)}")
    cases = _cases(table, layout)
    _demand_markers(table, cases, markers)
    chosen = [layout.forces[name].column for name in actuators]
    groups = [chosen, layout.position if measured or set(layout.position) <= set(table.titles) else []]
    groups += [] if layout.rest is None else [layout.rest]
    numbers = table.numbers([table.column(title) for group in groups for title in group])
    values, position, *others = np.split(numbers, np.cumsum([len(group) for group in groups])[:-1], axis=1)
    factors = [_factor(layout, *pair) for pair in zip(actuators, units, strict=True)]
    forces = _of_case(table, values, list(cases.values()), chosen) * factors
    places = _by_marker(layout.unit * position, cases, markers)
    rest = None if layout.rest is None else _by_marker(layout.unit * others[0], cases, markers)
    for found, columns in ((places, layout.position), (rest, layout.rest)):
        if found is not None:
            _demand_one_unit(table, cases, markers, found, columns)
    _demand_size(path, places, length)
    first = [min(case.values()) for case in cases.values()]
    ways = np.array(
        [
            _way(table, layout, row, cell)
            for row, cell in zip(first, _cells(table, layout.unloading, first), strict=True)
        ]
    )
    sessions = tuple("" if layout.session is None else one for one in _cells(table, layout.session, first))
    before = _before(_cells(table, layout.history, first), forces)
    return Cases(tuple(" ".join(case) for case in cases), sessions, forces, ways, places, rest, before)


Found = dict[tuple[str, ...], dict[str, int]]  # the row of each marker of each case


def _cases(table: TextTable, layout: Layout) -> Found:
    """InputError where a marker stands twice in a case."""
    keys = list(zip(*(table.texts(title) for title in layout.case), strict=True))
    found: Found = {}
    for row, (case, marker) in enumerate(zip(keys, table.texts(layout.marker), strict=True)):
        if marker in found.setdefault(case, {}):
            what = f"marker '{marker}' appears twice in case {' '.join(case)}"
            do = "add the column that tells the two cases apart to layout.case"
            raise InputError(what, where=table.where(row), do=do)
        found[case][marker] = row
    return found


def _demand_markers(table: TextTable, cases: Found, markers: list[str]) -> None:
    """InputError where none of the markers is there, or another name stands in some cases for one that lacks there: it
    is a marker misspelt. Names that the spec leaves out are others' markers."""
    known = set(markers)
    seen = {name for case in cases.values() for name in case}
    if not seen & known:
        what = f"holds none of the markers {', '.join(markers)}; it has {', '.join(sorted(seen))}"
        raise InputError(what, where=str(table.path), do="name the markers as the table does")
    for name in sorted(seen - known):
        inside = [case for case in cases.values() if name in case]
        if len(inside) < len(cases) and all(known - set(case) for case in inside):
            absent = ", ".join(sorted(known - set(inside[0])))
            what = f"marker '{name}' is none of {', '.join(markers)}, and this case lacks {absent}"
            raise InputError(what, where=table.where(inside[0][name]), do="name it as `markers` does, or leave it out")


def _factor(layout: Layout, actuator: str, unit: str) -> float:
    """Size of the unit of an actuator's column in `unit`."""
    try:
        return parse_quantity(f"1 {layout.forces[actuator].unit}", unit)
    except ValueError as error:
        raise SpecError(str(error), where=f"layout.forces.{actuator}.unit") from None


def _of_case(table: TextTable, values: np.ndarray, cases: list[dict[str, int]], columns: list[str]) -> np.ndarray:
    """(m, n_a) the forces of each case, of `values` (rows, n_a). InputError where rows of a case differ, or none has
    one."""
    found = np.empty((len(cases), len(columns)))
    for i, case in enumerate(cases):
        rows = sorted(case.values())
        for j, column in enumerate(columns):
            stated = [row for row in rows if not np.isnan(values[row, j])]
            if not stated:
                what = f"column '{column}': is empty, by which the robot was driven"
                raise InputError(what, where=table.where(rows[0]), do="fill in the cell, or leave the row out")
            other = next((row for row in stated if values[row, j] != values[stated[0], j]), None)
            if other is not None:
                what = f"column '{column}': is {values[other, j]:g}, and {values[stated[0], j]:g} in line "
                what += f"{table.rows[stated[0]].line} of the same case"
                raise InputError(what, where=table.where(other), do="give a case one force, or tell the cases apart")
            found[i, j] = values[stated[0], j]
    return found


def _by_marker(values: np.ndarray, cases: Found, markers: list[str]) -> np.ndarray:
    """(m, k, 3) of values (rows, 3); nan where a case has no row of a marker."""
    found = np.full((len(cases), len(markers), 3), np.nan)
    for i, case in enumerate(cases.values()):
        for j, marker in enumerate(markers):
            if marker in case and values.shape[1]:
                found[i, j] = values[case[marker]]
    return found


def _cells(table: TextTable, title: str | None, rows: list[int]) -> list[str]:
    """Of the rows, empty without a column."""
    if title is None:
        return [""] * len(rows)
    texts = table.texts(title)
    return [texts[row] for row in rows]


def _way(table: TextTable, layout: Layout, row: int, cell: str) -> float:
    if cell.lower() not in (*_TRUE, *_FALSE):
        what = f"column '{layout.unloading}': '{cell}' is neither 1 nor 0"
        raise InputError(what, where=table.where(row), do="write 1 where the load had been larger before, else 0")
    return -1.0 if cell.lower() in _TRUE else 1.0


def _before(histories: list[str], forces: np.ndarray) -> tuple[np.ndarray | None, ...]:
    earlier = ([j for j in range(i) if histories[j] == one] for i, one in enumerate(histories))
    return tuple(forces[js] if one else None for one, js in zip(histories, earlier, strict=True))


def _demand_one_unit(
    table: TextTable, cases: Found, markers: list[str], places: np.ndarray, columns: Sequence[str]
) -> None:
    """InputError where a marker's place is a thousand times nearer to the origin, or farther, than in other cases."""
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
    if not np.isfinite(places).any():
        return
    reach = float(np.nanmax(np.abs(places)))
    if not _SMALL * length <= reach <= _LARGE * length:
        what = f"places reach {reach:.3g} mm, and the robot is {length:.4g} mm long: the unit is another"
        raise InputError(what, where=str(path), do="state layout.unit, such as '1 m'")
