"""Tables of measured numbers with units: .csv, .parquet and .yaml.

In .csv and .parquet the unit stands behind the name of a column, `tip.x [mm]`; in .yaml every number has its own. An
empty cell was not measured."""

import csv
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.errors import InputError
from cfem.core.semicolons import read_rows
from cfem.core.units import parse_quantity

# The system unit of each column that a table may have.
Units = Mapping[str, str]


def read_table(path: Path, units: Units) -> dict[str, np.ndarray]:
    """Column name -> numbers in its system unit, nan where a cell is empty. InputError naming the file, the row and the
    column of what cannot be read."""
    return _READERS[_suffix(path)](path, units)


def _suffix(path: Path) -> str:
    if path.suffix not in _READERS:
        raise InputError(
            f"is not a table that can be read: expected {', '.join(_READERS)}, or a dataset's folder",
            where=str(path),
            do="save it in one of these formats",
        )
    if not path.exists():
        raise InputError("no such file", where=str(path), do="check the path")
    return path.suffix


def _read_yaml(path: Path, units: Units) -> dict[str, np.ndarray]:
    from ruamel.yaml import YAML, YAMLError

    try:
        records = YAML(typ="safe").load(path.read_text(encoding="utf-8"))
    except (YAMLError, UnicodeDecodeError) as error:
        raise InputError(f"is not valid YAML: {str(error).splitlines()[0]}", where=str(path)) from None
    if not isinstance(records, list) or not all(isinstance(record, dict) for record in records):
        raise InputError("expected a list of states, such as `- {cable.displacement: 5 mm, ...}`", where=str(path))
    names = list(dict.fromkeys(name for record in records for name in record))
    _demand_known(names, units, path)
    return {
        name: np.array(
            [_number(record.get(name), name, units, f"{path}: state {i + 1}") for i, record in enumerate(records)]
        )
        for name in names
    }


def _read_csv(path: Path, units: Units) -> dict[str, np.ndarray]:
    try:
        with open(path, newline="", encoding="utf-8-sig") as file:  # spreadsheets write a mark first
            header, *records = [record for record in read_rows(file) if record]
    except (ValueError, UnicodeDecodeError, csv.Error):
        raise InputError(
            "is not a table of comma-separated values", where=str(path), do="save it as CSV in UTF-8"
        ) from None
    wrong = next((i for i, record in enumerate(records) if len(record) != len(header)), None)
    if wrong is not None:
        raise InputError(f"row {wrong + 1}: {len(records[wrong])} cells, the header has {len(header)}", where=str(path))
    return _with_units(path, units, header, zip(*records, strict=True) if records else [[]] * len(header))


def _read_parquet(path: Path, units: Units) -> dict[str, np.ndarray]:
    from cfem.dataset.parquet import read_parquet

    table = read_parquet(path, do="write the table again")
    return _with_units(path, units, table.column_names, [table[name].to_pylist() for name in table.column_names])


def _demand_known(names: Iterable[str], units: Units, path: Path) -> None:
    strange = next((name for name in names if name not in units), None)
    if strange is not None:
        raise InputError(f"column '{strange}': expected one of {', '.join(units)}", where=str(path))


def _with_units(
    path: Path, units: Units, header: Sequence[str], columns: Iterable[Sequence[Any]]
) -> dict[str, np.ndarray]:
    """Header cells are 'name [unit]'."""
    found: dict[str, np.ndarray] = {}
    for title, cells in zip(header, columns, strict=True):
        match = re.fullmatch(r"\s*(\S+)\s*\[([^\[\]]+)\]\s*", title)
        if not match:
            raise InputError(f"column '{title}': expected a name and its unit, 'tip.x [mm]'", where=str(path))
        name, unit = match.groups()
        _demand_known([name], units, path)
        if name in found:
            raise InputError(f"column '{name}' appears twice", where=str(path), do="keep one of them")
        empty = [cell is None or cell == "" or cell != cell for cell in cells]
        texts = [None if hole else f"{cell} {unit}" for cell, hole in zip(cells, empty, strict=True)]
        found[name] = np.array(
            [_number(text, name, units, f"{path}: row {i + 1}") for i, text in enumerate(texts)], dtype=float
        )
    return found


def _number(text: Any, name: str, units: Units, where: str) -> float:
    """nan for None."""
    if text is None:
        return np.nan
    try:
        return parse_quantity(text, units[name])
    except ValueError as error:
        raise InputError(f"'{name}': {error}", where=where) from None


_READERS = {".yaml": _read_yaml, ".yml": _read_yaml, ".csv": _read_csv, ".parquet": _read_parquet}
