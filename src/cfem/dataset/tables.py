"""Tables of measured numbers with units: .csv, .parquet and .yaml.

In .csv and .parquet the unit stands behind the name of a column, `tip.x [mm]`; in .yaml every number has its own. An
empty cell was not measured."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.errors import InputError
from cfem.core.reading import demand_file
from cfem.core.text_table import read_rows, title_parts, titled
from cfem.core.units import parse_quantity

# The system unit of each column that a table may have.
Units = Mapping[str, str]


@dataclass(frozen=True)
class Table:
    """A table of numbers."""

    columns: dict[str, np.ndarray]  # numbers by name, each in its system unit, nan where a cell is empty
    places: tuple[str, ...]  # file and line of each row

    def __len__(self) -> int:
        return len(self.places)

    def stack(self, names: Sequence[str]) -> np.ndarray:
        """Numbers (rows, len(names)) of the columns, nan where the table has no such column."""
        absent = np.full(len(self), np.nan)
        return np.stack([self.columns.get(name, absent) for name in names], axis=1)


def read_table(path: Path, units: Units) -> Table:
    """Table of numbers from a file. InputError naming the file, the row and the column of what cannot be read."""
    return _READERS[_suffix(path)](path, units)


def _suffix(path: Path) -> str:
    """Suffix of a file of a known format. InputError where it has another, or there is no file."""
    if path.suffix not in _READERS:
        raise InputError(
            f"is not a table that can be read: expected {', '.join(_READERS)}, or a dataset's folder",
            where=str(path),
            do="save it in one of these formats",
        )
    demand_file(path)
    return path.suffix


def _read_yaml(path: Path, units: Units) -> Table:
    """Table of a YAML file with a list of states."""
    from ruamel.yaml import YAML, YAMLError

    try:
        records = YAML(typ="safe").load(path.read_text(encoding="utf-8"))
    except (YAMLError, UnicodeDecodeError) as error:
        raise InputError(f"is not valid YAML: {str(error).splitlines()[0]}", where=str(path)) from None
    if not isinstance(records, list) or not all(isinstance(record, dict) for record in records):
        raise InputError("expected a list of states, such as `- {cable.displacement: 5 mm, ...}`", where=str(path))
    names = list(dict.fromkeys(name for record in records for name in record))
    _demand_known(names, units, path)
    places = tuple(f"{path}: state {i + 1}" for i in range(len(records)))
    rows = list(zip(records, places, strict=True))
    columns = {name: np.array([_quantity(row.get(name), name, units, place) for row, place in rows]) for name in names}
    return Table(columns, places)


def _read_csv(path: Path, units: Units) -> Table:
    table = titled(path, read_rows(path))
    names, factors = _titles(path, units, table.titles)
    values = table.numbers(range(len(names))) * factors
    places = tuple(table.where(i) for i in range(len(table.rows)))
    return Table(dict(zip(names, values.T, strict=True)), places)


def _read_parquet(path: Path, units: Units) -> Table:
    """Table of a Parquet file."""
    from cfem.dataset.parquet import read_parquet

    table = read_parquet(path, do="write the table again")
    names, factors = _titles(path, units, table.column_names)
    places = tuple(f"{path}: row {i + 1}" for i in range(table.num_rows))
    columns = {
        name: factor * np.array([_number(*cell, name) for cell in zip(table[title].to_pylist(), places, strict=True)])
        for name, factor, title in zip(names, factors, table.column_names, strict=True)
    }
    return Table(columns, places)


def _demand_known(names: Iterable[str], units: Units, path: Path) -> None:
    strange = next((name for name in names if name not in units), None)
    if strange is not None:
        do = "rename it, or take it out of the table"
        raise InputError(f"column '{strange}': expected one of {', '.join(units)}", where=str(path), do=do)


def _titles(path: Path, units: Units, titles: Sequence[str]) -> tuple[list[str], np.ndarray]:
    """Names of the columns, and the size of each one's unit in the system's. Titles are 'name [unit]'."""
    names, factors = [], []
    for title in titles:
        name, unit = title_parts(title)
        if not unit:
            raise InputError(f"column '{title}': expected a name and its unit, 'tip.x [mm]'", where=str(path))
        _demand_known([name], units, path)
        if name in names:
            raise InputError(f"column '{name}' appears twice", where=str(path), do="keep one of them")
        names.append(name)
        factors.append(_quantity(f"1 {unit}", name, units, str(path)))
    return names, np.array(factors)


def _quantity(text: Any, name: str, units: Units, where: str) -> float:
    """Number of a text with a unit, in the column's system unit; nan for None."""
    if text is None:
        return np.nan
    try:
        return parse_quantity(text, units[name])
    except ValueError as error:
        raise InputError(f"'{name}': {error}", where=where) from None


def _number(value: Any, where: str, name: str) -> float:
    """Number of a cell; nan for None."""
    if value is None:
        return np.nan
    if isinstance(value, bool) or not isinstance(value, int | float) or np.isinf(value):
        raise InputError(f"'{name}': {value!r} is not a finite number", where=where)
    return float(value)


_READERS = {".yaml": _read_yaml, ".yml": _read_yaml, ".csv": _read_csv, ".parquet": _read_parquet}
