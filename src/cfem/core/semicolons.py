"""Tables of a spreadsheet whose language writes decimals with a comma: cells between semicolons, 0,5 for 0.5."""

import csv
import io
import re
from collections.abc import Iterator
from typing import TextIO

_DECIMAL = re.compile(r"\s*([-+]?\d*),(\d+(?:[eE][-+]?\d+)?)\s*")


def read_rows(file: TextIO) -> Iterator[list[str]]:
    """Rows of a table of comma-separated values; where more than half of the lines hold a semicolon, of those between
    semicolons, in which a number may have a comma for its point. The rows raise csv.Error where it is neither."""
    text = file.read()
    lines = [line for line in text.splitlines() if line.strip()]
    if 2 * sum(";" in line for line in lines) <= len(lines):
        return csv.reader(io.StringIO(text, newline=""), skipinitialspace=True)
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=";", skipinitialspace=True)
    return ([with_point(cell) for cell in row] for row in reader)


def with_point(cell: str) -> str:
    """'0,5' -> '0.5'; what is no such number as it is."""
    found = _DECIMAL.fullmatch(cell)
    return f"{found[1]}.{found[2]}" if found else cell
