"""Exports of camera systems: tables of OptiTrack Motive and Vicon Nexus, and .c3d files; and plain tables over time."""

import csv
import re
import warnings
from pathlib import Path

import numpy as np

from cfem.core.errors import InputError
from cfem.core.optional import demand
from cfem.core.semicolons import read_rows
from cfem.measurements.recording import Recording, make_recording

_UNITS = {"mm": 1.0, "millimeters": 1.0, "millimetres": 1.0, "cm": 10.0, "centimeters": 10.0, "m": 1e3}
_UNITS |= {"meters": 1e3, "metres": 1e3}
_AXES = ["X", "Y", "Z"]
_PLAIN = re.compile(r"(?P<marker>.+?)[_. :-](?P<axis>[xyz])(?:[_ ]?[\[(]?(?P<unit>mm|cm|m)[\])]?)?", re.IGNORECASE)


def read_recording(path: Path, unit: float | None = None) -> Recording:
    """unit: mm of one unit of the file's numbers, where it states none or a wrong one. InputError where the file is no
    export that is known."""
    if not path.exists():
        raise InputError("no such file", where=str(path), do="check the path")
    if path.suffix.lower() == ".c3d":
        return _c3d(path, unit)
    try:
        with open(path, newline="", encoding="utf-8-sig", errors="replace") as file:
            rows = [[cell.strip() for cell in row] for row in read_rows(file)]
    except csv.Error:
        raise InputError("is not a table of comma-separated values", where=str(path), do="export it as CSV") from None
    if rows and rows[0] and rows[0][0] == "Format Version":
        return _optitrack(path, rows, unit)
    if rows and rows[0] and rows[0][0].lower() == "trajectories":
        return _vicon(path, rows, unit)
    if rows and rows[0] and re.fullmatch(r"t|time|t_s|(t|time)[_ ]?[\[(]?s[\])]?", rows[0][0], re.IGNORECASE):
        return _plain(path, rows, unit)
    do = "export from Motive (CSV, with header), from Nexus (ASCII, trajectories), as .c3d, or write a table whose "
    do += "columns are t_s, NAME_x_mm, NAME_y_mm, NAME_z_mm"
    raise InputError("is no export of OptiTrack Motive or Vicon Nexus", where=str(path), do=do)


def _size(path: Path, name: str | None, unit: float | None) -> float:
    """mm of one unit."""
    if unit is not None:
        return unit
    if name is None or name.lower() not in _UNITS:
        what = "states no unit of length" if not name else f"states the unknown unit '{name}'"
        raise InputError(what, where=str(path), do="state `unit`, such as '1 m'")
    return _UNITS[name.lower()]


def _optitrack(path: Path, rows: list[list[str]], unit: float | None) -> Recording:
    """Motive, format 1.2 and later: rows of types, names and kinds of number above 'Frame, Time'."""
    about = dict(zip(rows[0][::2], rows[0][1::2], strict=False))
    start = next((i for i, row in enumerate(rows) if row and row[0] == "Frame"), None)
    if start is None or start < 3:
        raise InputError("has no row that begins with 'Frame'", where=str(path), do="export it with its header")
    head = [row for row in rows[1:start] if any(row)]
    kinds = next((row for row in head if "Position" in row), None)
    types, names = head[0], head[1]
    axes = rows[start]
    columns: dict[str, dict[str, int]] = {}
    wanted = "Marker" if "Marker" in types else "Rigid Body Marker"
    for i, axis in enumerate(axes):
        if axis in _AXES and i < len(types) and types[i] == wanted and (kinds is None or kinds[i] == "Position"):
            columns.setdefault(names[i], {})[axis] = i
    whole = {name: place for name, place in columns.items() if len(place) == 3}
    if not whole:
        raise InputError("exports no marker's position", where=str(path), do="tick markers and positions in Motive")
    size = _size(path, about.get("Length Units"), unit)
    data = [row for row in rows[start + 1 :] if row and row[0]]
    time = _numbers(path, data, [1], start)[:, 0]
    points = _points(path, data, list(whole.values()), start) * size
    return make_recording(time, list(whole), points, str(path))


def _vicon(path: Path, rows: list[list[str]], unit: float | None) -> Recording:
    """Nexus: the rate, names above their first column, axes, units, frames; the block ends with an empty row."""
    try:
        rate = float(rows[1][0])
        names, axes, units = rows[2], rows[3], rows[4]
        first = axes.index("X")
    except (IndexError, ValueError):
        do = "export trajectories as ASCII with their header"
        raise InputError("has no header of a Nexus export", where=str(path), do=do) from None
    columns = {}
    for i in range(first, len(axes) - 2, 3):
        if i < len(names) and names[i] and axes[i : i + 3] == _AXES:
            columns[names[i].split(":")[-1]] = dict(zip(_AXES, range(i, i + 3), strict=True))
    if not columns:
        raise InputError("names no marker", where=str(path), do="export trajectories as ASCII with their header")
    size = _size(path, units[first] if first < len(units) else None, unit)
    data = []
    for row in rows[5:]:
        if not row or not row[0]:
            break
        data.append(row)
    frames = _numbers(path, data, [0], 4)[:, 0]
    points = _points(path, data, list(columns.values()), 4) * size
    return make_recording((frames - frames[:1]) / rate, list(columns), points, str(path))


def _plain(path: Path, rows: list[list[str]], unit: float | None) -> Recording:
    """One header: time in seconds, then three columns a marker, such as tip_x_mm."""
    columns: dict[str, dict[str, int]] = {}
    units = set()
    for i, name in enumerate(rows[0][1:], start=1):
        found = _PLAIN.fullmatch(name)
        if found:
            columns.setdefault(found["marker"], {})[found["axis"].upper()] = i
            units.add(found["unit"])
    whole = {name: place for name, place in columns.items() if len(place) == 3}
    if not whole:
        do = "name them as tip_x_mm, tip_y_mm, tip_z_mm"
        raise InputError("has no marker with columns of x, y and z", where=str(path), do=do)
    if len(units) > 1:
        raise InputError("gives columns of markers in different units", where=str(path), do="use one")
    size = _size(path, units.pop(), unit)
    data = [row for row in rows[1:] if any(row)]
    time = _numbers(path, data, [0], 0)[:, 0]
    return make_recording(time, list(whole), _points(path, data, list(whole.values()), 0) * size, str(path))


def _c3d(path: Path, unit: float | None) -> Recording:
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


def _points(path: Path, rows: list[list[str]], places: list[dict[str, int]], above: int) -> np.ndarray:
    """(n, m, 3)."""
    index = [place[axis] for place in places for axis in _AXES]
    return _numbers(path, rows, index, above).reshape(len(rows), len(places), 3)


def _numbers(path: Path, rows: list[list[str]], columns: list[int], above: int) -> np.ndarray:
    """(n, k), nan where a cell is empty."""
    out = np.full((len(rows), len(columns)), np.nan)
    for i, row in enumerate(rows):
        for j, column in enumerate(columns):
            text = row[column] if column < len(row) else ""
            if text:
                try:
                    out[i, j] = float(text)
                except ValueError:
                    what = f"row {above + i + 2}: '{text}' is not a number"
                    raise InputError(what, where=str(path)) from None
    return out
