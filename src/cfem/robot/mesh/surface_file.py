"""Closed surfaces in files: .stl, .obj, .3mf, .ply, .off, and triangles in .vtk, .vtu, .msh, .inp."""

import re
import zipfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from xml.etree import ElementTree  # nosec B405

import numpy as np

from cfem.core.console.shown import counted
from cfem.core.errors import InputError
from cfem.core.reading import demand_file
from cfem.core.stl import read_stl
from cfem.mechanics.mesh import boundary_facets
from cfem.robot.geometry import Geometry, MeshFile, singles
from cfem.robot.mesh.mend import MendedSurface, mend
from cfem.robot.mesh.mesh_file import SOLID_CORNERS, join_pieces, read_data
from cfem.robot.mesh.obj_file import read_obj

# Numbers of a .3mf in mm, by the unit that it states.
_UNITS = {"micron": 1e-3, "millimeter": 1.0, "centimeter": 10.0, "inch": 25.4, "foot": 304.8, "meter": 1000.0}


@cache  # until the file changes
def _read(path: Path, body: int, changed: tuple[int, int]) -> MendedSurface:
    return mend(*_triangles(path), str(path), body)


def read_surface(path: Path, body: int = 1) -> tuple[np.ndarray, np.ndarray, tuple[str, ...]]:
    """X (n, 3) in the file's unit (mm of a .3mf), triangles (m, 3) of a closed surface, normals out of the material;
    and what was mended. body: of several in the file, the largest first. InputError where the file cannot be read, the
    surface not be closed, or there is no such body."""
    return _known(path, body)[:3]


def count_bodies(path: Path) -> int:
    """Number of separate bodies that the surface in a file bounds. Errors as `read_surface`."""
    return _known(path, 1).bodies


def _known(path: Path, body: int) -> MendedSurface:
    demand_file(path)
    stat = path.stat()
    return _read(path, body, (stat.st_mtime_ns, stat.st_size))


def mended(path: Path, surface: bool, body: int = 1) -> tuple[str, ...]:
    """Phrases about the mends of a file when it is read, as the surface of a body or as cells."""
    if surface:
        return _known(path, body).mends
    merged = join_pieces(read_data(path))
    return (f"merged {counted(merged, 'duplicate node')}, which kept cells apart",) if merged else ()


def mends_of(geometry: Geometry, folder: Path) -> Iterator[tuple[Path, str]]:
    """Files of a geometry that are mended when they are read, each with a phrase on how."""
    for single in singles(geometry).values():
        if isinstance(single, MeshFile):
            phrases = mended(folder / single.path, single.meshed_here, single.body)
            yield from ((single.path, phrase) for phrase in phrases)


def _triangles(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """X (n, 3) and triangles (m, 3) of a file as they stand there; of solid cells their boundary."""
    suffix = path.suffix.lower()
    if suffix == ".stl":
        return read_stl(path)
    if suffix == ".obj":
        return read_obj(path)
    if suffix == ".3mf":
        return _read_3mf(path)
    data = read_data(path)
    X = np.asarray(data.points, dtype=float)
    solids = [block for block in data.cells if block.type in SOLID_CORNERS]
    if solids:
        faces = [boundary_facets(block.data[:, : SOLID_CORNERS[block.type]].astype(np.int64)) for block in solids]
    else:
        faces = [_faces(block.data) for block in data.cells if block.dim == 2]
    triangles = [part for polygons in faces for part in _split(polygons)]
    if not triangles:
        raise InputError("has neither triangles nor solid cells", where=str(path), do="export the surface again")
    return X, np.concatenate(triangles).astype(np.int64)


def _faces(data) -> np.ndarray:
    """Corners of faces, without the nodes in the middle of their sides."""
    data = np.asarray(data)
    return data[:, : {6: 3, 8: 4, 9: 4}.get(data.shape[1], data.shape[1])]


def _split(faces: np.ndarray) -> list[np.ndarray]:
    """Triangles of polygons (f, k), each cut from its first corner: k - 2 arrays (f, 3)."""
    return [faces[:, [0, k, k + 1]] for k in range(1, faces.shape[1] - 1)]


def _read_3mf(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Triangles of all objects that the file builds, in their places: X (n, 3) mm, (m, 3)."""
    try:
        with zipfile.ZipFile(path) as package:
            names = [name for name in package.namelist() if name.lower().endswith(".model")]
            roots = [_parsed(package.read(name), path) for name in names]
    except (OSError, zipfile.BadZipFile, zipfile.LargeZipFile) as error:
        raise InputError(f"is no .3mf file: {error}", where=str(path), do="export it again") from None
    objects, items, unit = {}, [], 1.0
    for root in roots:
        unit = _UNITS.get(root.get("unit", "millimeter"), 1.0)
        objects |= {node.get("id"): node for node in root.iter("object")}
        items += [(item.get("objectid"), _transform(item)) for item in root.iter("item")]
    points, triangles, count = [], [], 0

    def add(name: str | None, motion: np.ndarray, depth: int = 0) -> None:
        """Appends an object and its components, moved by `motion` (4, 3)."""
        nonlocal count
        node = objects.get(name)
        if node is None or depth > 20:
            raise InputError(f"builds an object '{name}' that it does not have", where=str(path), do="export it again")
        corners = [[float(vertex.get(axis)) for axis in "xyz"] for vertex in node.iter("vertex")]
        if corners:
            points.append(np.column_stack([np.array(corners), np.ones(len(corners))]) @ motion)
            faces = [[int(triangle.get(key)) for key in ("v1", "v2", "v3")] for triangle in node.iter("triangle")]
            triangles.append(np.array(faces, dtype=np.int64).reshape(-1, 3) + count)
            count += len(corners)
        for part in node.iter("component"):
            within = np.column_stack([_transform(part), [0, 0, 0, 1]])
            add(part.get("objectid"), within @ motion, depth + 1)

    try:
        for name, motion in items or [(name, _transform(None)) for name in objects]:
            add(name, motion)
        if not points:
            raise InputError("holds no body", where=str(path), do="export the body again")
        X, faces = np.concatenate(points) * unit, np.concatenate(triangles)
    except (TypeError, ValueError) as error:
        raise InputError(f"is damaged: {error}", where=str(path), do="export it again") from None
    if len(faces) == 0 or faces.min() < 0 or faces.max() >= len(X) or not np.isfinite(X).all():
        raise InputError("is damaged: its triangles name vertices that it does not have", where=str(path))
    return X, faces


def _parsed(text: bytes, path: Path) -> ElementTree.Element:
    """Tree of an XML text, its names without their namespaces. A document type, in which entities could be defined, is
    refused."""
    if b"<!DOCTYPE" in text or b"<!ENTITY" in text:
        raise InputError("has a document type, which no .3mf has", where=str(path), do="export it again")
    try:
        root = ElementTree.fromstring(text)  # nosec B314 - without entities
    except ElementTree.ParseError as error:
        raise InputError(f"is damaged: {error}", where=str(path), do="export it again") from None
    for node in root.iter():
        node.tag = re.sub(r"\{.*\}", "", str(node.tag))
    return root


def _transform(node: ElementTree.Element | None) -> np.ndarray:
    """Matrix (4, 3) by which a row (x, y, z, 1) is multiplied to place a component or item."""
    text = None if node is None else node.get("transform")
    if text is None:
        return np.vstack([np.eye(3), np.zeros(3)])
    return np.array([float(value) for value in text.split()]).reshape(4, 3)
