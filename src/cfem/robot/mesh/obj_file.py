"""Faces of a Wavefront .obj file: its vertices and what they bound, whatever textures, normals and groups it has."""

from itertools import pairwise
from pathlib import Path

import numpy as np

from cfem.core.errors import InputError


def read_obj(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """X (n, 3), triangles (m, 3), a polygon cut from its first corner. InputError where the file is damaged or has no
    faces."""
    X: list[list[float]] = []
    triangles: list[tuple[int, int, int]] = []
    for number, line in enumerate(path.read_text(encoding="utf-8", errors="replace").splitlines(), 1):
        key, *words = line.partition("#")[0].split() or [""]
        try:
            if key == "v":
                X.append([float(word) for word in words[:3]])
            elif key == "f":
                corners = [_corner(word, len(X)) for word in words]
                triangles += [(corners[0], *pair) for pair in pairwise(corners[1:])]
        except ValueError as error:
            raise InputError(f"line {number} is damaged: {error}", where=str(path), do="export it again") from None
    if not triangles:
        raise InputError("has no faces", where=str(path), do="export the surface again")
    points, faces = np.array([x if len(x) == 3 else [np.nan] * 3 for x in X]), np.array(triangles)
    if faces.max() >= len(X) or not np.isfinite(points).all():
        what = "is damaged: a face names a vertex that it does not have, or a vertex has not three finite numbers"
        raise InputError(what, where=str(path), do="export it again")
    return points, faces


def _corner(word: str, known: int) -> int:
    """Index from 0 of 'v', 'v/vt', 'v//vn' or 'v/vt/vn': v counts from 1, or back from the vertex before where it is
    negative. ValueError for anything else."""
    index = int(word.partition("/")[0])
    if index == 0 or index < -known:
        raise ValueError(f"there is no vertex {index}")
    return index - 1 if index > 0 else known + index
