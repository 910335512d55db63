"""Meshes on disk: ours as .vtu that ParaView opens (sets as 0/1 arrays), and tetrahedra of the user's own."""

from pathlib import Path

import meshio
import numpy as np

from cfem.core.errors import InputError
from cfem.core.files import write_whole
from cfem.mechanics.mesh import Mesh, tet_volumes

_SET = "set:"


def write_mesh(path: Path, mesh: Mesh) -> None:
    """All cells and boundary facets; each set is an array 'set:<name>' on points (nodes) or cells (facets)."""
    suffix = "10" if mesh.order == 2 else ""
    blocks = [("tetra" + suffix, mesh.cells), ("triangle" + ("6" if suffix else ""), mesh.facets)]
    on_points = {_SET + name: _flags(len(mesh.X), nodes) for name, nodes in mesh.node_sets.items()}
    on_cells = {
        _SET + name: [np.zeros(len(mesh.cells), np.int8), _flags(len(mesh.facets), facets)]
        for name, facets in mesh.facet_sets.items()
    }
    whole = meshio.Mesh(mesh.X, blocks, point_data=on_points, cell_data=on_cells)
    partial = path.with_suffix(".part.vtu")
    meshio.write(partial, whole, file_format="vtu")
    write_whole(path, partial.read_bytes())
    partial.unlink()


def read_mesh(path: Path) -> Mesh:
    """What `write_mesh` wrote. InputError where it is missing or damaged."""
    data = _read(path)
    blocks = {block.type: index for index, block in enumerate(data.cells)}
    solid = next((name for name in ("tetra10", "tetra") if name in blocks), None)
    surface = {"tetra10": "triangle6", "tetra": "triangle"}.get(solid or "")
    if solid is None or surface not in blocks:
        raise InputError("is no mesh of cfem: tetrahedra and their boundary are missing", where=str(path))
    facet_block = blocks[surface]
    return Mesh(
        X=np.ascontiguousarray(data.points, dtype=float),
        cells=data.cells[blocks[solid]].data.astype(np.int64),
        facets=data.cells[facet_block].data.astype(np.int64),
        node_sets={
            name.removeprefix(_SET): np.flatnonzero(flags)
            for name, flags in data.point_data.items()
            if name.startswith(_SET)
        },
        facet_sets={
            name.removeprefix(_SET): np.flatnonzero(flags[facet_block])
            for name, flags in data.cell_data.items()
            if name.startswith(_SET)
        },
    )


def read_tetrahedra(path: Path, unit: float) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """A user's mesh (.vtu, .vtk, .msh): X (n, 3) in mm (`unit` mm a number), cells (m, 4), named node sets from
    physical groups and sets. Nodes that no tetrahedron uses are dropped, and mid-edge nodes."""
    data = _read(path)
    cells = [block.data[:, :4] for block in data.cells if block.type in ("tetra", "tetra10")]
    if not cells:
        kinds = sorted({block.type for block in data.cells})
        raise InputError(f"holds no tetrahedra, only {kinds}", where=str(path), do="mesh the volume with tetrahedra")
    used, numbered = np.unique(np.concatenate(cells), return_inverse=True)
    X = np.asarray(data.points, dtype=float)[used] * unit
    if X.shape[1] != 3 or not np.isfinite(X).all():
        raise InputError("has coordinates that are not finite numbers in three dimensions", where=str(path))
    numbered = numbered.reshape(-1, 4)
    if (np.abs(tet_volumes(X, numbered)) < 1e-12 * np.ptp(X, axis=0).max() ** 3).any():
        raise InputError("has flat tetrahedra, of no volume", where=str(path), do="mesh it anew")
    return X, numbered, {name: nodes for name, nodes in _named_nodes(data, used).items() if len(nodes)}


def _named_nodes(data: meshio.Mesh, used: np.ndarray) -> dict[str, np.ndarray]:
    sets = {name: np.asarray(nodes, dtype=int) for name, nodes in data.point_sets.items()}
    for name, flags in data.point_data.items():
        if name.startswith(_SET):
            sets[name.removeprefix(_SET)] = np.flatnonzero(flags)
    for name, (tag, dimension) in data.field_data.items():
        groups = data.cell_data.get("gmsh:physical", [])
        inside = [
            block.data[tags == tag].ravel()
            for block, tags in zip(data.cells, groups, strict=False)
            if block.dim == dimension
        ]
        sets[name] = np.unique(np.concatenate(inside)) if inside else np.empty(0, dtype=int)
    return {name: np.flatnonzero(np.isin(used, nodes)) for name, nodes in sets.items()}


def _read(path: Path) -> meshio.Mesh:
    if not path.is_file():
        raise InputError("no such file", where=str(path), do="check the path, or run the stage that makes it")
    try:
        return meshio.read(path)
    except SystemExit as error:  # meshio exits the process on formats that it does not know
        raise InputError("is of no mesh format that can be read", where=str(path)) from error
    except Exception as error:  # a parser of damaged bytes may raise anything
        raise InputError(f"cannot be read as a mesh: {type(error).__name__} {error}", where=str(path)) from error


def _flags(n: int, members: np.ndarray) -> np.ndarray:
    flags = np.zeros(n, dtype=np.int8)
    flags[members] = 1
    return flags
