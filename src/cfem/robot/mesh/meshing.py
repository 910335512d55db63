"""Mesh of a scene's geometry: by gmsh in a process of its own, as a block, or from the user's file."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cfem.core.errors import SpecError
from cfem.core.reading import demand_file
from cfem.mechanics.element import ELEMENTS
from cfem.mechanics.mesh import TET_EDGES, Mesh, boundary_facets, quadratic, tet_volumes
from cfem.robot import selection
from cfem.robot.cad import Box, Difference, File, Placed, Solid, SurfaceSolid, as_data
from cfem.robot.catalogue.bar import Bar
from cfem.robot.catalogue.cross_sections import stiff_flop_section
from cfem.robot.catalogue.solids import CATALOGUE
from cfem.robot.catalogue.stiff_flop import StiffFlop, slice_mesh
from cfem.robot.catalogue.taper import Taper, filled, rod_mesh
from cfem.robot.geometry import Assembly, MeshFile, Part, Single
from cfem.robot.mesh import hexahedra
from cfem.robot.mesh.ask_gmsh import ask_gmsh
from cfem.robot.mesh.mesh_file import read_own
from cfem.robot.mesh.placement import join, place, place_back, seen_from
from cfem.robot.shape.deform import shaped
from cfem.robot.spec import Meshing, SceneSpec

_FAR = 1e4  # mm, beyond any robot

Region = Box | Placed


@dataclass(frozen=True)
class Grading:
    """Sizes (n,) mm wanted at the nodes of a mesh, linear between its corners."""

    mesh: Mesh
    sizes: np.ndarray


def make_mesh(scene: SceneSpec, folder: Path, grading: Grading | None = None) -> tuple[Mesh, float | None]:
    """The scene's mesh, and the CAD volume in mm^3 where there is one. Paths in the spec are relative to `folder`.
    grading: sizes beside those of the spec, of which the smallest counts.

    Raises InputError (file, missing libraries), SpecError (an element that the geometry cannot be meshed with),
    NumericalError (cannot be meshed)."""
    if grading is not None:
        grading = Grading(grading.mesh.base, grading.sizes)
    regions = [
        Box(tuple(item.region.low.tolist()), tuple(item.region.high.tolist()))
        for item in scene.materials
        if isinstance(item.region, selection.Box)
    ] + [_behind_sheet(item.faces) for item in scene.layers if getattr(item.faces, "flat", None) is not None]
    if isinstance(scene.geometry, StiffFlop):
        length = _length(scene.geometry)
        demand_cells(scene.mesh, length / scene.mesh.size, np.array([length, *[2 * scene.geometry.radius] * 2]))
        mesh = slice_mesh(scene.geometry, scene.mesh.element, scene.mesh.size)
        return mesh, None if scene.mesh.element == "beam" else length * stiff_flop_section(scene.geometry).area
    if isinstance(scene.geometry, Taper) and scene.mesh.element == "beam":
        length, width = float(scene.geometry.places[-1]), 2 * float(scene.geometry.radii.max())
        demand_cells(scene.mesh, length / scene.mesh.size, np.array([length, width, width]))
        return rod_mesh(scene.geometry, scene.mesh.size), None
    if isinstance(scene.geometry, Assembly):
        parts = {part.name: _part(part, scene.mesh, regions, folder, grading) for part in scene.geometry.parts}
        mesh = join({name: mesh for name, (mesh, _) in parts.items()})
        volumes = [volume for _, volume in parts.values()]
        volume = None if None in volumes else sum(volumes)
    else:
        mesh, volume = corner_mesh(scene.geometry, scene.mesh, regions, folder, "geometry", grading)
    mesh = with_middles(mesh) if ELEMENTS[scene.mesh.element].order == 2 else mesh
    return (mesh, volume) if scene.shape is None else (shaped(scene.shape, mesh), None)


def _behind_sheet(sheet: selection.Box) -> Box:
    """Box of all places behind a box without thickness, on which a mesh then has faces."""
    high = sheet.high.copy()
    high[sheet.flat] = _FAR
    return Box(tuple(sheet.low.tolist()), tuple(high.tolist()))


def _length(geometry: StiffFlop) -> float:
    """Length mm of the trunk, all modules."""
    return geometry.modules * geometry.module_length


def _part(
    part: Part, meshing: Meshing, regions: Sequence[Box], folder: Path, grading: Grading | None
) -> tuple[Mesh, float | None]:
    """Mesh of a part, corner nodes only, in the scene's coordinates, and its CAD volume. Errors as `make_mesh`."""
    part_meshing = meshing.model_copy(update={"size": part.size or meshing.size, "refine": part.refine})
    part_regions = [seen_from(region, part) for region in regions]
    if grading is not None:
        graded = replace(grading.mesh, cells=grading.mesh.cells[grading.mesh.cell_sets[part.name]])
        grading = Grading(place_back(graded, part), grading.sizes)
    mesh, volume = corner_mesh(part.geometry, part_meshing, part_regions, folder, f"part '{part.name}'", grading)
    return place(mesh, part), volume


def corner_mesh(
    geometry: Single,
    meshing: Meshing,
    regions: Sequence[Region],
    folder: Path,
    where: str,
    grading: Grading | None = None,
) -> tuple[Mesh, float | None]:
    """Mesh of corner nodes only in the geometry's own coordinates, and the CAD volume where there is one. A mesh that
    is made here conforms to the regions, a surface from a file excepted; one of hexahedra to those along its
    axes."""
    kind = "hexahedra" if ELEMENTS[meshing.element].n_nodes == 8 else "tetrahedra"
    if isinstance(geometry, MeshFile) and not geometry.meshed_here:
        mesh, volume = read_own(folder / geometry.path, geometry.unit), None
        in_file = "hexahedra" if mesh.cells.shape[1] == 8 else "tetrahedra"
        if in_file != kind:
            elements = "hex8" if in_file == "hexahedra" else "tet4, tet10 or tet10p0"
            raise SpecError(
                f"{where}: {geometry.path} holds {in_file}, and mesh.element {meshing.element} is of {kind}",
                do=f"set mesh.element to {elements}",
            )
        return mesh, volume
    solid, cell_sets = solid_of(geometry, folder), {}
    if kind == "hexahedra":
        X, cells, volume = _hexahedra(geometry, solid, meshing, regions, where)
    else:
        axis = None if meshing.mirror is None else "xyz".index(meshing.mirror)
        half = solid if axis is None else Difference(solid, (_behind(axis),))
        conforms_to = () if isinstance(geometry, MeshFile) else regions
        X, cells, volume, cell_sets = run_gmsh(half, meshing, conforms_to, grading)
        if axis is not None:
            X, cells, volume = *mirrored(X, cells, axis), 2 * volume
        inverted = tet_volumes(X, cells) < 0
        cells[inverted] = cells[inverted][:, [0, 2, 1, 3]]
        if isinstance(geometry, Taper):
            X = filled(geometry, X, cells, meshing.size)
    return Mesh(X, cells, boundary_facets(cells), cell_sets=cell_sets), volume


def _behind(axis: int) -> Box:
    """Box of all places where the coordinate `axis` is negative."""
    low, high = np.full(3, -_FAR), np.full(3, _FAR)
    high[axis] = 0.0
    return Box(tuple(low), tuple(high))


def mirrored(X: np.ndarray, cells: np.ndarray, axis: int) -> tuple[np.ndarray, np.ndarray]:
    """Tetrahedra on one side of the plane where the coordinate `axis` is 0, and their mirror images."""
    X = X.copy()
    on_plane = np.abs(X[:, axis]) < 1e-9 * np.ptp(X, axis=0).max()
    X[on_plane, axis] = 0.0
    image = np.arange(len(X))
    image[~on_plane] = len(X) + np.arange((~on_plane).sum())
    mirror_X = X[~on_plane].copy()
    mirror_X[:, axis] *= -1
    return np.concatenate([X, mirror_X]), np.concatenate([cells, image[cells]])


def _corner_sizes(grading: Grading) -> list[list[float]]:
    """Rows, one a cell: x of its four corners, y, z, then their sizes; in steps of 2 %, so that the rounding of
    whatever computed them does not change the mesh. Two cells more lie beyond opposite corners of the body, as gmsh's
    search tree loses cells that touch its bounds."""
    corners = grading.mesh.cells[:, :4]
    sizes = np.exp(np.round(np.log(grading.sizes) * 50) / 50)
    X, sizes = grading.mesh.X[corners], sizes[corners]
    low, high = X.min(axis=(0, 1)), X.max(axis=(0, 1))
    far = (high - low).max() * np.vstack([np.zeros(3), np.eye(3)])
    X = np.concatenate([X, [high + 0.1 * far.max() + far, low - 0.1 * far.max() - far]])
    sizes = np.concatenate([sizes, np.full((2, 4), sizes.max())])
    return np.hstack([*(X[:, :, axis] for axis in range(3)), sizes]).tolist()


def _hexahedra(
    geometry: Single, solid: Solid, meshing: Meshing, regions: Sequence[Region], where: str
) -> tuple[np.ndarray, np.ndarray, float]:
    """X (n, 3) mm, cells (m, 8) and volume mm^3 of a bar. SpecError for other geometries and for boxes of finer
    cells."""
    if not isinstance(geometry, Bar):
        raise SpecError(
            f"{where}: kind {geometry.kind} cannot be meshed with hex8",
            do="hex8 works with kind bar and with mesh files of hexahedra; here use tet10p0, tet10 or tet4",
        )
    if meshing.refine:
        raise SpecError(f"{where}: refine is for tetrahedra, not for hex8", do="leave it out and make size smaller")
    extent = np.array([geometry.length, geometry.width, geometry.height])
    demand_cells(meshing, float(np.ceil(extent / meshing.size).prod()), extent)
    X, cells = hexahedra.block(solid, meshing.size, [region for region in regions if isinstance(region, Box)])
    return X, cells, geometry.length * geometry.width * geometry.height


def with_middles(mesh: Mesh) -> Mesh:
    """Quadratic tetrahedra; a middle of an edge is in the node sets that both of its ends are in."""
    X, cells, facets = quadratic(mesh.X, mesh.cells, mesh.facets)
    edges = cells[:, :4][:, TET_EDGES].reshape(-1, 2)
    middles = cells[:, 4:].ravel()
    node_sets = {}
    for name, nodes in mesh.node_sets.items():
        inside = np.zeros(len(X), dtype=bool)
        inside[nodes] = True
        inside[middles[inside[edges].all(axis=1)]] = True
        node_sets[name] = np.flatnonzero(inside)
    return Mesh(X, cells, facets, node_sets, mesh.facet_sets, mesh.cell_sets)


def corners_of(mesh: Mesh) -> Mesh:
    """The linear mesh of which `with_middles` made this one, whose first nodes are the corners."""
    cells = mesh.cells[:, :4]
    count = int(cells.max()) + 1
    node_sets = {name: nodes[nodes < count] for name, nodes in mesh.node_sets.items()}
    return Mesh(mesh.X[:count], cells, mesh.facets[:, :3], node_sets, mesh.facet_sets, mesh.cell_sets)


def solid_of(geometry: Single, folder: Path) -> Solid:
    """A geometry as a tree of solids."""
    if type(geometry) in CATALOGUE:
        return CATALOGUE[type(geometry)](geometry)
    path = folder / geometry.path
    demand_file(path, "check geometry.path")
    if isinstance(geometry, MeshFile):
        return SurfaceSolid(str(path), geometry.unit, geometry.body)
    return File(str(path), geometry.unit or 1.0)


def run_gmsh(
    solid: Solid, meshing: Meshing, regions: Sequence[Region] = (), grading: Grading | None = None
) -> tuple[np.ndarray, np.ndarray, float, dict[str, np.ndarray]]:
    """X (n, 3) mm, cells (m, 4), CAD volume mm^3, and the cells of each solid of a file that holds several, solid-1 and
    so on: the same for the same arguments. No cell straddles the surface of a region."""
    refine = [
        {
            "low": box.corners.min(axis=0).tolist(),
            "high": box.corners.max(axis=0).tolist(),
            "size": box.size,
            "blend": box.blend,
        }
        for box in meshing.refine
    ]
    job = {
        "solid": as_data(solid),
        "size": meshing.size,
        "refine": refine,
        "regions": [as_data(region) for region in regions],
        "grading": None if grading is None else _corner_sizes(grading),
        "max_cells": meshing.max_cells,
    }
    answer = ask_gmsh(job, solid)
    if "about" in answer:
        demand_cells(meshing, float(answer["about"]), answer["extent"])
    solid_of_cells = answer.get("solid", np.empty(0, dtype=np.int64))
    solids = {f"solid-{number + 1}": np.flatnonzero(solid_of_cells == number) for number in np.unique(solid_of_cells)}
    return answer["X"], answer["cells"], float(answer["volume"]), solids


def demand_cells(meshing: Meshing, about: float, extent: np.ndarray) -> None:
    """Raises SpecError where the cells would be too many, or larger than the body, extent (3,) mm."""
    body = " x ".join(f"{side:.3g}" for side in extent)
    if meshing.size > 1.01 * extent.max():
        what = f"cells of {meshing.size:g} mm are larger than the body, {body} mm"
        raise SpecError(what, where="mesh.size", do="check its unit, and that of the geometry")
    if not about <= meshing.max_cells:
        what = f"cells of {meshing.size:g} mm fill a body of {body} mm with about {about:.1e} of them"
        do = f"check the units, make size larger, or allow more than mesh.max_cells: {meshing.max_cells}"
        raise SpecError(what, where="mesh.size", do=do)


def measure(solid: Solid) -> tuple[float, float]:
    """Volume mm^3 and area mm^2 of the surface of a body, without a mesh. InputError where a file holds no one body."""
    return measure_solids(solid)[:2]


def measure_solids(solid: Solid) -> tuple[float, float, int]:
    """Volume mm^3 and area mm^2 of the surface of a body, and the number of solids in its file that make it up. Errors
    as `measure`."""
    answer = ask_gmsh({"solid": as_data(solid), "size": None}, solid)
    return float(answer["volume"]), float(answer["area"]), int(answer.get("solids", 1))


def write_cad(solid: Solid, files: Sequence[Path]) -> None:
    """Writes a body for CAD (.step, exact) and for printing (.stl, about 0.05 mm off at most), in mm."""
    job = {"solid": as_data(solid), "write": [str(file) for file in files], "deviation": 0.05}
    ask_gmsh(job, solid)
