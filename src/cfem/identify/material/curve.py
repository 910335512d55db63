"""A tensile test as a laboratory writes it: a table with a column of stretch, strain or extension and one of
engineering stress or force, their units in the titles. Lines above the titles, a machine's own, are passed over."""

import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cfem.core.errors import InputError, SpecError
from cfem.core.text_table import TableRow, TextTable, read_rows, title_parts
from cfem.core.units import parse_quantity
from cfem.identify.material.forms import Mode

FEWEST = 6  # points
_LARGEST_STRAIN = 20.0  # above it, a strain without a unit is taken for per cent
_ACROSS, _UP = ("stretch", "strain", "extension", "displacement"), ("stress", "force", "load")
_NOISE = 0.01  # of the range of stretch, by which a rising curve may go back


@dataclass(frozen=True)
class Curve:
    """A measured curve of m points.

    mode:    of the test
    stretch: (m,) in rising order
    stress:  (m,) MPa over the area at rest
    source:  the file
    title:   of the column of stress or force"""

    mode: Mode
    stretch: np.ndarray
    stress: np.ndarray
    source: str
    title: str = ""

    @property
    def sense(self) -> str:
        """The sense of the load."""
        if self.stretch[-1] <= 1:
            return "compression"
        return "tension" if self.stretch[0] > 1 - _NOISE else "compression and tension"


def read_curve(path: Path, mode: Mode = "uniaxial", length: float | None = None, area: float | None = None) -> Curve:
    """The curve in a file. InputError naming the file, the line and the column of what cannot be read.

    length, area: mm and mm^2 of the specimen at rest, for columns of extension and force"""
    rows = [row for row in read_rows(path) if not row.blank]
    start, across, up = _titles(rows, path)
    table = TextTable(path, rows[start].cells, tuple(rows[start + 1 :]))
    if len(table.rows) < FEWEST:
        raise InputError(
            f"holds {len(table.rows)} points, and a fit needs {FEWEST}", where=str(path), do="record more points"
        )
    x, y = _points(table, (across, up))
    for values, column in ((x, across), (y, up)):
        _demand_sign(values, table.titles[column], path)
    stretch = _stretch(x, table.titles[across], length, path)
    stress = _stress(y, table.titles[up], area, path)
    return Curve(mode, *_rising(stretch, stress, table), str(path), table.titles[up])


def up_to(curve: Curve, most: float) -> Curve:
    """The part of a curve up to a stretch."""
    kept = curve.stretch <= most
    if kept.sum() < FEWEST:
        what = f"has {kept.sum()} points up to a stretch of {most:g}, and a fit needs {FEWEST}"
        raise SpecError(what, where=curve.source, do="raise --up-to")
    return replace(curve, stretch=curve.stretch[kept], stress=curve.stress[kept])


def _points(table: TextTable, columns: tuple[int, int]) -> np.ndarray:
    """Numbers (2, m) of two columns. InputError where a cell is empty."""
    values = table.numbers(columns)
    gaps = np.argwhere(np.isnan(values))
    if len(gaps):
        row, column = gaps[0]
        what = f"column '{table.titles[columns[column]]}': is empty"
        raise InputError(what, where=table.where(row), do="fill in the cell, or leave the row out")
    return values.T


def _titles(rows: list[TableRow], path: Path) -> tuple[int, int, int]:
    """Number of the row that holds the titles, and the columns of stretch or strain and of stress or force."""
    for index, row in enumerate(rows):
        cells = row.cells
        across, up = (_columns(cells, words) for words in (_ACROSS, _UP))
        if across and up:
            for column in (across, up):
                if len(column) > 1:
                    named = " and ".join(f"'{cells[number]}'" for number in column)
                    what = f"columns {named} describe the same quantity"
                    raise InputError(what, where=str(path), do="keep the one of engineering strain or stress")
            return index, across[0], up[0]
    what = "has no titles such as 'strain, stress [MPa]' above its numbers"
    raise InputError(what, where=str(path), do=f"name one column {', '.join(_ACROSS)}, and one {', '.join(_UP)}")


def _columns(cells: tuple[str, ...], words: tuple[str, ...]) -> list[int]:
    """Columns of a quantity: those called engineering or nominal where there are such, none called true."""
    named = [i for i, cell in enumerate(cells) if any(word in cell.lower() for word in words)]
    named = [i for i in named if not re.search(r"\b(true|rate|cauchy)\b", cells[i].lower())]
    engineering = [i for i in named if re.search(r"engineering|nominal", cells[i].lower())]
    return engineering or named


def _demand_sign(values: np.ndarray, title: str, path: Path) -> None:
    """Raises InputError where a column of compression counts it above zero: it would be read as tension."""
    if "compress" in title.lower() and "stretch" not in title.lower() and values.mean() > 0:
        what = f"'{title}': values above zero would be read as tension"
        raise InputError(what, where=str(path), do="write strains and stresses of compression below zero")


def _stretch(x: np.ndarray, title: str, length: float | None, path: Path) -> np.ndarray:
    """Stretches (m,) from a column of stretch, strain or extension. InputError where its meaning is not certain."""
    name, unit = title_parts(title)
    if any(word in name.lower() for word in ("extension", "displacement")):
        stretch = 1 + _scaled(x, title, "mm", path) / _demanded(length, "length", "--length '33 mm'", title, path)
    elif "stretch" in name.lower():
        stretch = x
    elif unit in ("%", "percent"):
        stretch = 1 + x / 100
    elif unit in ("", "-", "1", "mm/mm", "m/m"):
        if x.max() > _LARGEST_STRAIN:
            what = f"'{title}': a strain of {x.max():g} without a unit"
            raise InputError(what, where=str(path), do="write 'strain [%]' where it is per cent")
        stretch = 1 + x
    else:
        raise InputError(
            f"'{title}': strain is a plain number or in %", where=str(path), do="write 'strain' or 'strain [%]'"
        )
    if not (stretch > 0).all():
        what = f"'{title}': a stretch of {stretch.min():g}: a specimen keeps a length above zero"
        raise InputError(what, where=str(path), do="say whether the column is strain or stretch")
    return stretch


def _stress(y: np.ndarray, title: str, area: float | None, path: Path) -> np.ndarray:
    """Nominal stresses (m,) MPa from a column of stress or force."""
    name, _ = title_parts(title)
    if "stress" in name.lower():
        return _scaled(y, title, "MPa", path)
    return _scaled(y, title, "N", path) / _demanded(area, "area of the section", "--area '18 mm^2'", title, path)


def _demanded(value: float | None, what: str, option: str, title: str, path: Path) -> float:
    if value is None:
        raise SpecError(f"'{title}': needs the specimen's {what} at rest", where=str(path), do=f"give {option}")
    return value


def _scaled(values: np.ndarray, title: str, system: str, path: Path) -> np.ndarray:
    _, unit = title_parts(title)
    if not unit:
        raise InputError(f"'{title}': has no unit", where=str(path), do=f"write '{title} [{system}]'")
    try:
        return values * parse_quantity(f"1 {unit}", system)
    except ValueError as error:
        raise InputError(f"'{title}': {error}", where=str(path)) from None


def _rising(stretch: np.ndarray, stress: np.ndarray, table: TextTable) -> tuple[np.ndarray, np.ndarray]:
    """Stretch and stress in order of stretch. InputError where the test goes back: a law has one stress for each
    stretch."""
    span = np.ptp(stretch)
    if span == 0:
        raise InputError(
            "holds one stretch only", where=str(table.path), do="record a test that stretches the specimen"
        )
    strain = np.abs(stretch - 1)
    back = np.flatnonzero(np.maximum.accumulate(strain) - strain > _NOISE * span)
    if len(back) and not (np.maximum.accumulate(stretch) - stretch <= _NOISE * span).all():
        what = f"the stretch falls from line {table.rows[back[0]].line} on: unloading, or a second cycle"
        raise InputError(what, where=str(table.path), do="keep the first loading; an elastic law has one branch")
    order = np.argsort(stretch, kind="stable")
    if not (stretch - stretch.mean()) @ stress > 0:
        raise InputError(
            "stress does not rise with stretch", where=str(table.path), do="look at the columns and their signs"
        )
    return stretch[order], stress[order]
