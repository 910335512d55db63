"""Exports of camera systems: tables of OptiTrack Motive and Vicon Nexus, and .c3d files; and plain tables over time."""

import re
import warnings
from collections.abc import Mapping, Sequence
from itertools import takewhile
from pathlib import Path

import numpy as np

from cfem.core.errors import InputError
from cfem.core.optional import demand
from cfem.core.reading import demand_file
from cfem.core.text_table import TableRow, TextTable, read_rows, titled
from cfem.identify.recordings.recording import MarkerRecording, make_recording

_UNITS = {"mm": 1.0, "millimeters": 1.0, "millimetres": 1.0, "cm": 10.0, "centimeters": 10.0, "m": 1e3}
_UNITS |= {"meters": 1e3, "metres": 1e3}
_AXES = ["X", "Y", "Z"]
_TIME = re.compile(r"(t|time)([_ ]?[\[(]?(?P<unit>s|ms)[\])]?)?", re.IGNORECASE)
_PLAIN = re.compile(r"(?P<marker>.+?)[_. :-](?P<axis>[xyz])(?:[_ ]?[\[(]?(?P<unit>mm|cm|m)[\])]?)?", re.IGNORECASE)


def read_recording(path: Path, unit: float | None = None) -> MarkerRecording:
    """The markers of an export. InputError where the file is no export that is known.

    unit: mm of one unit of the file's numbers, where it states none or a wrong one"""
    demand_file(path)
    if path.suffix.lower() == ".c3d":
        return _c3d(path, unit)
    lines = read_rows(path)
    first = next((row.cells for row in lines[:1]), ())
    if first[:1] == ("Format Version",):
        return _optitrack(path, lines, unit)
    if first and first[0].lower() == "trajectories":
        return _vicon(path, lines, unit)
    if first and _TIME.fullmatch(first[0]):
        return _plain(titled(path, [row for row in lines if not row.blank]), unit)
    do = "export from Motive (CSV, with header), from Nexus (ASCII, trajectories), as .c3d, or write a table whose "
    do += "columns are t_s, NAME_x_mm, NAME_y_mm, NAME_z_mm"
    raise InputError("is no export of OptiTrack Motive or Vicon Nexus", where=str(path), do=do)


def _size(path: Path, name: str | None, unit: float | None) -> float:
    """Size mm of one unit."""
    if unit is not None:
        return unit
    if name is None or name.lower() not in _UNITS:
        what = "states no unit of length" if not name else f"states the unknown unit '{name}'"
        raise InputError(what, where=str(path), do="state `unit`, such as '1 m'")
    return _UNITS[name.lower()]


def _optitrack(path: Path, lines: list[TableRow], unit: float | None) -> MarkerRecording:
    """Recording of Motive, format 1.2 and later: rows of types, names and kinds of number above 'Frame, Time'."""
    rows = [row.cells for row in lines]
    about = dict(zip(rows[0][::2], rows[0][1::2], strict=False))
    start = next((i for i, row in enumerate(rows) if row and row[0] == "Frame"), None)
    if start is None or start < 3:
        raise InputError("has no row that begins with 'Frame'", where=str(path), do="export it with its header")
    head = [row for row in rows[1:start] if any(row)]
    kinds = next((row for row in head if "Position" in row), None)
    types, names = head[0], head[1]
    columns: dict[str, dict[str, int]] = {}
    wanted = "Marker" if "Marker" in types else "Rigid Body Marker"
    for i, axis in enumerate(rows[start]):
        if axis in _AXES and i < len(types) and types[i] == wanted and (kinds is None or kinds[i] == "Position"):
            if axis in columns.setdefault(names[i], {}):
                raise _named_twice(names[i], path, lines[start])
            columns[names[i]][axis] = i
    if not any(len(place) == 3 for place in columns.values()):
        raise InputError("exports no marker's position", where=str(path), do="tick markers and positions in Motive")
    size = _size(path, about.get("Length Units"), unit)
    return _recording(path, [row for row in lines[start + 1 :] if row.cells[:1] > ("",)], 1, columns, size)


def _vicon(path: Path, lines: list[TableRow], unit: float | None) -> MarkerRecording:
    """Recording of Nexus: the rate, names above their first column, axes, units, frames; the block ends with an empty
    row."""
    rows = [row.cells for row in lines]
    try:
        rate = float(rows[1][0])
        names, axes, units = rows[2], rows[3], rows[4]
        first = axes.index("X")
    except (IndexError, ValueError):
        do = "export trajectories as ASCII with their header"
        raise InputError("has no header of a Nexus export", where=str(path), do=do) from None
    if not 0 < rate < np.inf:
        raise InputError(f"states a rate of {rows[1][0]} frames a second", where=f"{path}:{lines[1].line}")
    columns: dict[str, dict[str, int]] = {}
    for i in range(first, len(axes) - 2, 3):
        if i < len(names) and names[i] and list(axes[i : i + 3]) == _AXES:
            name = names[i].split(":")[-1]
            if name in columns:
                raise _named_twice(name, path, lines[2])
            columns[name] = dict(zip(_AXES, range(i, i + 3), strict=True))
    if not columns:
        raise InputError("names no marker", where=str(path), do="export trajectories as ASCII with their header")
    size = _size(path, units[first] if first < len(units) else None, unit)
    data = list(takewhile(lambda row: row.cells[:1] > ("",), lines[5:]))
    return _recording(path, data, 0, columns, size, rate=rate)


def _named_twice(name: str, path: Path, row: TableRow) -> InputError:
    what = f"two markers are called '{name}'"
    return InputError(what, where=f"{path}:{row.line}", do="name them apart, and export again")


def _plain(table: TextTable, unit: float | None) -> MarkerRecording:
    """Recording of a plain table: one row of titles, time in s or ms, then three columns a marker, such as
    tip_x_mm."""
    tick = 1e-3 if (_TIME.fullmatch(table.titles[0])["unit"] or "").lower() == "ms" else 1.0
    columns: dict[str, dict[str, int]] = {}
    units = set()
    for i, name in enumerate(table.titles[1:], start=1):
        match = _PLAIN.fullmatch(name)
        if match:
            columns.setdefault(match["marker"], {})[match["axis"].upper()] = i
            units.add(match["unit"])
    if not any(len(place) == 3 for place in columns.values()):
        do = "name them as tip_x_mm, tip_y_mm, tip_z_mm"
        raise InputError("has no marker with columns of x, y and z", where=str(table.path), do=do)
    if len(units) > 1:
        raise InputError("gives columns of markers in different units", where=str(table.path), do="use one")
    return _recording(table.path, table.rows, 0, columns, _size(table.path, units.pop(), unit), tick)


def _recording(
    path: Path,
    rows: Sequence[TableRow],
    clock: int,
    columns: Mapping[str, Mapping[str, int]],
    size: float,
    tick: float = 1.0,
    rate: float | None = None,
) -> MarkerRecording:
    """The recording in rows of numbers; markers that lack an axis are left out.

    clock:   the column of time, or of frames where a rate is given
    columns: by marker and axis
    size:    mm of one unit
    tick:    s of one unit of time
    rate:    frames a second"""
    complete = {name: place for name, place in columns.items() if len(place) == 3}
    index = [clock, *(place[axis] for place in complete.values() for axis in _AXES)]
    titles = {clock: "time" if rate is None else "frame"}
    titles |= {place[axis]: f"{name} {axis}" for name, place in complete.items() for axis in _AXES}
    table = TextTable(path, tuple(titles.get(i, "") for i in range(max(titles) + 1)), tuple(rows))
    values = table.numbers(index)
    time = tick * values[:, 0] if rate is None else (values[:, 0] - values[:1, 0]) / rate
    back = np.flatnonzero(~(np.diff(time) > 0))
    if len(back):
        what = "time does not increase from the row before"
        do = "sort the rows, and keep one of those with the same time"
        raise InputError(what, where=f"{path}:{rows[back[0] + 1].line}", do=do)
    points = size * values[:, 1:].reshape(len(values), len(complete), 3)
    return make_recording(time, list(complete), points, str(path))


def _c3d(path: Path, unit: float | None) -> MarkerRecording:
    """The markers of a .c3d file, by the library c3d."""
    demand("c3d", where=str(path))
    import c3d

    try:
        with open(path, "rb") as file, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of analog channels that are not there
            reader = c3d.Reader(file)
            labels = [str(label).strip() for label in reader.point_labels]
            frames = [(number, points.copy()) for number, points, _ in reader.read_frames()]
            rate, stated = float(reader.point_rate), reader.get("POINT:UNITS")
            name = stated.string_value.strip() if stated is not None else None
    except Exception as error:  # the reader's own errors share no base class
        raise InputError(f"cannot be read as .c3d: {error}", where=str(path)) from None
    if not frames:
        raise InputError("holds no frames of markers", where=str(path), do="export the positions of the markers")
    data = np.array([points for _, points in frames], float)
    points = data[:, : len(labels), :3] * _size(path, name, unit)
    points[data[:, : len(labels), 3] < 0] = np.nan  # the residual of what was not seen
    numbers = np.array([number for number, _ in frames], float)
    names = [label or f"marker-{i + 1}" for i, label in enumerate(labels)]
    return make_recording((numbers - numbers[0]) / rate, names, points, str(path))
