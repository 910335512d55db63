"""Tables of text, as spreadsheets, machines and cameras write them: cells between commas, semicolons or tabs.

Python's csv module parses. The checks here refuse what has two meanings: a number is never guessed."""

import csv
import io
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cfem.core.artefact.files import open_regular, write_whole
from cfem.core.errors import InputError
from cfem.core.units import parse_number

_WITH_POINT = re.compile(r"[-+]?[0-9]*\.[0-9]*(?:[eE][-+]?[0-9]+)?")
_WITH_COMMA = re.compile(r"[-+]?[0-9]*,[0-9]+(?:[eE][-+]?[0-9]+)?")
_TWO_MEANINGS = re.compile(r"[-+]?[1-9][0-9]{0,2},[0-9]{3}")  # 2,730: 2.73 or 2730
_GAPS = ("", "nan")
_TITLE = re.compile(r"\s*(.*?)\s*(?:[\[(]\s*([^\[\]()]*?)\s*[\])])?\s*", re.DOTALL)


@dataclass(frozen=True)
class TableRow:
    """A row of a text table."""

    line: int  # of the file, from 1, on which the row ends
    cells: tuple[str, ...]  # without blanks around them, none of an empty line or a comment

    @property
    def blank(self) -> bool:
        """True if nothing stands in it, be it between separators."""
        return not any(self.cells)


def read_rows(path: Path) -> list[TableRow]:
    """Rows of a file; a line that begins with '#' is a comment. InputError where the file is no such table."""
    with open_regular(path) as file:
        data = file.read()
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        what = f"is not a text file in UTF-8: byte 0x{data[error.start]:02x} is none of its characters"
        raise InputError(what, where=f"{path}:{line}", do="save it as CSV in UTF-8") from None
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    lines = ["" if line.lstrip().startswith("#") else line for line in text.split("\n")]
    filled = [line for line in lines if line.strip()]
    mark = next((separator for separator in ";\t" if 2 * sum(separator in line for line in filled) > len(filled)), ",")
    reader = csv.reader(io.StringIO("\n".join(lines)), delimiter=mark, skipinitialspace=mark != "\t", strict=True)
    rows = []
    try:
        for cells in reader:
            stripped = tuple(cell.strip() for cell in cells)
            rows.append(TableRow(reader.line_num, () if stripped == ("",) else stripped))
    except csv.Error as error:
        what = f"is not a table of comma-separated values: {error}"
        raise InputError(what, where=f"{path}:{reader.line_num}", do="save it as CSV in UTF-8") from None
    return rows


@dataclass(frozen=True)
class TextTable:
    """A table of numbers below titles."""

    path: Path
    titles: tuple[str, ...]
    rows: tuple[TableRow, ...]

    def column(self, title: str) -> int:
        """Index of the column with this title. InputError where no column is called so."""
        if title not in self.titles:
            what = f"has no column '{title}', only {', '.join(self.titles)}"
            raise InputError(what, where=str(self.path), do="name the columns as the table does")
        return self.titles.index(title)

    def texts(self, title: str) -> list[str]:
        """Texts of a column's cells."""
        column = self.column(title)
        return [row.cells[column] for row in self.rows]

    def where(self, row: int) -> str:
        """Place of a row: file and line."""
        return f"{self.path}:{self.rows[row].line}"

    def numbers(self, columns: Sequence[int]) -> np.ndarray:
        """Numbers (rows, columns), nan where a cell is empty, says nan, or lacks at the end of its row. Decimals have a
        point, or have a comma in all of these columns. InputError naming line and column of what is no finite number,
        and of what could be two."""
        cells = [[row.cells[column] if column < len(row.cells) else "" for column in columns] for row in self.rows]
        comma = self._decimal_comma(cells, columns)
        values = np.full((len(cells), len(columns)), np.nan)
        for i, row in enumerate(cells):
            for j, cell in enumerate(row):
                if cell.lower() not in _GAPS:
                    values[i, j] = self._number(cell, comma, i, columns[j])
        return values

    def _number(self, cell: str, comma: bool, row: int, column: int) -> float:
        text = cell.replace(",", ".") if comma and _WITH_COMMA.fullmatch(cell) else cell
        try:
            return parse_number(text)
        except ValueError as error:
            raise self._refused(row, column, str(error), "write plain numbers, such as -1.5e3") from None

    def _decimal_comma(self, cells: list[list[str]], columns: Sequence[int]) -> bool:
        """True if these columns have a decimal comma. InputError where some numbers have a point and others a comma, or
        no comma is a decimal comma for certain."""
        places = [(i, j) for i, row in enumerate(cells) for j, cell in enumerate(row) if _WITH_COMMA.fullmatch(cell)]
        if not places:
            return False
        pointed = next((cell for row in cells for cell in row if _WITH_POINT.fullmatch(cell)), None)
        unclear = [(i, j) for i, j in places if _TWO_MEANINGS.fullmatch(cells[i][j])]
        if pointed is None and len(unclear) < len(places):
            return True
        i, j = (unclear or places)[0]
        what = f"'{cells[i][j]}' has a comma"
        what += " and may be either of two numbers" if pointed is None else f" where '{pointed}' has a point"
        do = "write decimals with a point, and no mark between thousands"
        raise self._refused(i, columns[j], what, do)

    def _refused(self, row: int, column: int, what: str, do: str) -> InputError:
        return InputError(f"column '{self.titles[column]}': {what}", where=self.where(row), do=do)


def title_parts(title: str) -> tuple[str, str]:
    """Name and unit of a title such as 'tip.x [mm]' or 'stress (MPa)'; the unit is empty where it has none."""
    name, unit = _TITLE.fullmatch(title).groups()
    return name, unit or ""


def titled(path: Path, rows: Sequence[TableRow]) -> TextTable:
    """The first row that is not empty has the titles. InputError where one stands twice, or another row has not their
    number of cells."""
    head, *records = [row for row in rows if row.cells] or [TableRow(0, ())]
    if head.blank:
        raise InputError("is empty", where=str(path), do="give a table with titles above its numbers")
    twice = next((title for title in head.cells if title and head.cells.count(title) > 1), None)
    if twice is not None:
        what = f"two columns are called '{twice}'"
        raise InputError(what, where=f"{path}:{head.line}", do="keep one, or name them apart")
    for row in records:
        if len(row.cells) != len(head.cells):
            what = f"{len(row.cells)} cells, and the titles are {len(head.cells)}"
            do = "numbers with a decimal comma need semicolons between cells"
            raise InputError(what, where=f"{path}:{row.line}", do=do)
    return TextTable(path, head.cells, tuple(records))


def write_rows(path: Path, titles: Sequence[str], rows: Iterable[Sequence[str | float]]) -> None:
    """Writes a table with commas: numbers with four decimals, an empty cell for nan."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(titles)
    table.writerows([cell if isinstance(cell, str) else _cell(cell) for cell in row] for row in rows)
    write_whole(path, text.getvalue().encode())


def _cell(number: float) -> str:
    return "" if np.isnan(number) else f"{number:.4f}"
