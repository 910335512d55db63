"""Triangles of an STL file, binary or text."""

import re
from pathlib import Path

import numpy as np

from cfem.core.errors import InputError

_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_VERTEX = re.compile(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)")
_HEADER = 80


def read_stl(path: Path, unit: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (v, 3) mm and triangles (t, 3) of an STL file; corners at equal places are one vertex. unit: mm of the
    file's numbers, which say none. Normals are those of the order of corners. InputError where it cannot be read."""
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", where=str(path), do="check the path") from None
    corners = _binary(data)
    if corners is None:
        corners = _text(data, path)
    if not len(corners):
        raise InputError("has no triangles", where=str(path), do="export the surface again")
    if not np.isfinite(corners).all():
        raise InputError("has coordinates that are not finite numbers", where=str(path), do="export the surface again")
    vertices, place = np.unique(corners.reshape(-1, 3) + 0.0, axis=0, return_inverse=True)
    return vertices * unit, place.reshape(-1, 3)


def _binary(data: bytes) -> np.ndarray | None:
    """Corners (t, 3, 3), None where the length is not what a binary file of its count has."""
    if len(data) < _HEADER + 4:
        return None
    count = int.from_bytes(data[_HEADER : _HEADER + 4], "little")
    if len(data) != _HEADER + 4 + count * _RECORD.itemsize:
        return None
    return np.frombuffer(data, _RECORD, count, _HEADER + 4)["corners"].astype(float)


def _text(data: bytes, path: Path) -> np.ndarray:
    """Triangles (t, 3, 3) of an STL file in text. InputError where the file is cut or is none."""
    vertices = _VERTEX.findall(data)
    damaged = (
        not data.lstrip().startswith(b"solid") or len(vertices) % 3 or data.count(b"facet normal") * 3 != len(vertices)
    )
    if damaged or b"endsolid" not in data:
        what = "is not an STL file, or is cut: neither text with whole facets nor binary of the length that it states"
        raise InputError(what, where=str(path), do="export the surface again")
    try:
        return np.array(vertices, dtype=float).reshape(-1, 3, 3)
    except ValueError as error:
        raise InputError(f"has a coordinate that is no number: {error}", where=str(path)) from None
