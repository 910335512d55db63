"""Meshes on disk: ours as .vtu that ParaView opens (sets as 0/1 arrays), and the user's of tetrahedra or hexahedra."""

import contextlib
import io
from pathlib import Path

import meshio
import numpy as np
from meshio.abaqus._abaqus import abaqus_to_meshio_type

from cfem.contact.surface.facets import components
from cfem.core.artefact.files import write_whole
from cfem.core.errors import InputError
from cfem.core.reading import demand_file
from cfem.mechanics.mesh import Mesh, boundary_facets, hex_volumes, tet_volumes
from cfem.robot.mesh.abaqus_sets import element_sets
from cfem.robot.mesh.mesh_sets import CELL_SET, SET, arrays, named_sets
from cfem.robot.mesh.same_place import representatives

REMESH = "set geometry.remesh: true"  # what to do about cells that are none
UNSHAPED = "unshaped"  # point data: the nodes before the free form
# Cells by their number of nodes, as meshio calls them and their facets.
_NAMES = {4: ("tetra", "triangle"), 10: ("tetra10", "triangle6"), 8: ("hexahedron", "quad")}
abaqus_to_meshio_type["C3D4H"] = "tetra"  # meshio 5 calls it by a kind that it does not have
# Kinds of solid cells in the user's files, of which the corners alone are taken: kind -> number of corners.
SOLID_CORNERS = {"tetra": 4, "tetra10": 4, "hexahedron": 8, "hexahedron20": 8, "hexahedron27": 8}


def write_mesh(path: Path, mesh: Mesh) -> None:
    """Writes all cells and boundary facets; each set is an array 'set:<name>' on points (nodes) or cells (facets), or
    'cellset:<name>' on cells (cells)."""
    solid, surface = _NAMES[mesh.cells.shape[1]]
    m, k = len(mesh.cells), len(mesh.facets)
    on_points = {SET + name: _flags(len(mesh.X), nodes) for name, nodes in mesh.node_sets.items()}
    on_facets = {SET + name: [_flags(m, []), _flags(k, facets)] for name, facets in mesh.facet_sets.items()}
    on_solid = {CELL_SET + name: [_flags(m, cells), _flags(k, [])] for name, cells in mesh.cell_sets.items()}
    if mesh.unshaped is not None:
        on_points[UNSHAPED] = mesh.unshaped
    blocks = [(solid, mesh.cells), (surface, mesh.facets)]
    data = meshio.Mesh(mesh.X, blocks, point_data=on_points, cell_data=on_facets | on_solid)
    partial = path.with_suffix(".part.vtu")
    meshio.write(partial, data, file_format="vtu")
    write_whole(path, partial.read_bytes())
    partial.unlink()


def read_mesh(path: Path) -> Mesh:
    """Mesh that `write_mesh` wrote. InputError where the file is missing or damaged."""
    data = read_data(path)
    blocks = {block.type: index for index, block in enumerate(data.cells)}
    solid, surface = next((pair for pair in _NAMES.values() if pair[0] in blocks), (None, None))
    if solid is None or surface not in blocks:
        raise InputError("is not a mesh of cfem: its cells or their boundary are missing", where=str(path))
    solid_block, facet_block = blocks[solid], blocks[surface]
    return Mesh(
        X=np.ascontiguousarray(data.points, dtype=float),
        cells=data.cells[solid_block].data.astype(np.int64),
        facets=data.cells[facet_block].data.astype(np.int64),
        node_sets={name: np.flatnonzero(flags) for name, flags in arrays(data.point_data, SET)},
        facet_sets={name: np.flatnonzero(flags[facet_block]) for name, flags in arrays(data.cell_data, SET)},
        cell_sets={name: np.flatnonzero(flags[solid_block]) for name, flags in arrays(data.cell_data, CELL_SET)},
        unshaped=np.asarray(data.point_data[UNSHAPED], float) if UNSHAPED in data.point_data else None,
    )


def read_own(path: Path, unit: float) -> Mesh:
    """A user's mesh (.vtu, .vtk, .msh, .inp) of tetrahedra or of hexahedra, corners only, upright, its numbers `unit`
    mm.

    Sets are those of mesh_sets.py. Nodes that no cell uses are dropped, duplicate ones merged as in `join_pieces`.
    InputError for anything else."""
    data = read_data(path)
    join_pieces(data)
    kinds = sorted({block.type for block in data.cells if block.dim == 3})
    corners = {SOLID_CORNERS.get(kind, 0) for kind in kinds}
    if corners not in ({4}, {8}):
        got = kinds or sorted({block.type for block in data.cells})
        raise InputError(
            f"must hold tetrahedra or hexahedra and no other solid cells, got {', '.join(got) or 'none'}",
            where=str(path),
            do="mesh the volume with either",
        )
    solid = [index for index, block in enumerate(data.cells) if block.dim == 3]
    cells = np.concatenate([data.cells[index].data[:, : max(corners)] for index in solid])
    if len(np.unique(np.sort(cells, axis=1), axis=0)) < len(cells):
        raise InputError(
            "lists cells twice, as .msh 2 does where groups overlap", where=str(path), do="save it as .msh 4.1"
        )
    used, numbered = np.unique(cells, return_inverse=True)
    X = np.asarray(data.points, dtype=float)[used] * unit
    cells = _upright(X, numbered.reshape(cells.shape), path)
    facets = boundary_facets(cells)
    return Mesh(X, cells, facets, *named_sets(data, solid, used, facets))


def join_pieces(data: meshio.Mesh) -> int:
    """Merges nodes at one place, where the solid cells are fewer pieces then, and returns how many. The two sides of a
    slit in one piece stay apart."""
    X = np.asarray(data.points, dtype=float)
    solids = [np.asarray(block.data) for block in data.cells if block.dim == 3]
    same = representatives(X)
    merged = int((same != np.arange(len(X))).sum())
    if not merged or all(components(same[cells])[0] == components(cells)[0] for cells in solids):
        return 0
    for block in data.cells:
        block.data = same[block.data]
    for flags in data.point_data.values():
        if flags.ndim == 1:
            np.maximum.at(flags, same, flags.copy())
    data.point_sets = {name: same[np.asarray(nodes, dtype=int)] for name, nodes in data.point_sets.items()}
    return merged


def _upright(X: np.ndarray, cells: np.ndarray, path: Path) -> np.ndarray:
    """The cells with those of negative volume turned inside out. InputError where one has no volume."""
    volumes, mirror = (
        (hex_volumes(X, cells), [4, 5, 6, 7, 0, 1, 2, 3])
        if cells.shape[1] == 8
        else (tet_volumes(X, cells), [0, 2, 1, 3])
    )
    if (np.abs(volumes) < 1e-12 * np.ptp(X, axis=0).max() ** 3).any():
        raise InputError("has flat cells without volume", where=str(path), do=REMESH)
    return np.where((volumes < 0)[:, None], cells[:, mirror], cells)


def read_data(path: Path) -> meshio.Mesh:
    """Data of a mesh file, its coordinates and node numbers checked. InputError where it cannot be read."""
    demand_file(path, "check the path, or run the stage that makes it")
    try:
        with contextlib.redirect_stderr(said := io.StringIO()), contextlib.redirect_stdout(said):  # meshio prints
            data = meshio.read(path, _format(path))
        if path.suffix.lower() == ".inp":
            data.cell_sets = element_sets(path, data.cells)
    except SystemExit as error:  # meshio exits the process on formats that it does not know
        why = said.getvalue().partition("Error: Couldn't read file")[0].strip()
        what = "is not in a mesh format that can be read"
        raise InputError(f"{what}: {why}" if why else what, where=str(path)) from error
    except InputError:
        raise
    except Exception as error:  # a parser of damaged bytes may raise anything
        # meshio's own limit: a .msh 4 with Mesh.SaveAll
        do = "save it from gmsh without Mesh.SaveAll: what is in groups only" if "gmsh:physical" in str(error) else None
        raise InputError(f"cannot be read as a mesh: {type(error).__name__} {error}", where=str(path), do=do) from error
    X = np.asarray(data.points)
    if X.ndim != 2 or X.shape[1] != 3 or X.dtype.kind not in "fiu" or not np.isfinite(X).all():
        raise InputError("has coordinates that are not finite numbers in three dimensions", where=str(path))
    for block in data.cells:
        nodes = np.asarray(block.data)
        strange = nodes[(nodes < 0) | (nodes >= len(X))]
        if len(strange):
            what = f"its {block.type} cells name node {strange[0]}, but its nodes are 0 to {len(X) - 1}"
            raise InputError(what, where=str(path), do="write the file again")
    return data


def _format(path: Path) -> str | None:
    """Format in meshio's words where the suffix misleads, else None: some programs call a .vtu a .vtk."""
    with open(path, "rb") as file:
        head = file.read(200).lstrip()
    if path.suffix.lower() == ".vtk" and (head.startswith(b"<?xml") or head.startswith(b"<VTKFile")):
        return "vtu"
    return "vtk" if path.suffix.lower() == ".vtu" and head.startswith(b"# vtk") else None


def _flags(size: int, members) -> np.ndarray:
    flags = np.zeros(size, dtype=np.int8)
    flags[np.asarray(members, dtype=int)] = 1
    return flags
