"""The body in a file, known by a coarse mesh of it."""

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from cfem.core.errors import InputError
from cfem.core.reading import demand_file
from cfem.init.body.interior import Interior, interior
from cfem.init.body.voxels import Voxels, voxels
from cfem.mechanics.mesh import Mesh
from cfem.robot.geometry import SURFACES, MeshFile, StepFile
from cfem.robot.mesh.mesh_file import read_data, read_own
from cfem.robot.mesh.meshing import corner_mesh, measure_solids, solid_of
from cfem.robot.mesh.surface_file import mended, read_surface
from cfem.robot.spec import Meshing

STEP, BREP, MESH = (".step", ".stp"), (".brep", ".brp"), (".vtu", ".vtk", ".msh", ".inp")
FILES = STEP + BREP + SURFACES + MESH
# A regular tetrahedron of edge h has the volume h^3 / 8.485.
_REGULAR = 6 * np.sqrt(2)
_ATTEMPTS = 4
_MISSING = 0.02  # of the volume: what straight edges may leave out of a round body; `cfem mesh` calls 0.03 poor


@dataclass(frozen=True)
class Source:
    """A file as it is: volume and surface in the cube and square of its unit (of mm in a STEP or 3MF file);
    mesh: of the file where its cells are taken; mended: what was mended, a phrase each; body: of several that surfaces
    in the file bound."""

    path: Path
    volume: float
    area: float
    mesh: Mesh | None
    remesh: bool = False
    mended: tuple[str, ...] = ()
    body: int = 1

    @property
    def has_unit(self) -> bool:
        return self.path.suffix.lower() in (*STEP, ".3mf")

    @cached_property
    def extent(self) -> np.ndarray | None:
        """Size (3,) in the file's unit; None of a CAD file, which is not looked into."""
        if self.mesh is None and self.path.suffix.lower() in STEP + BREP:
            return None
        X = self.mesh.X if self.mesh is not None else read_surface(self.path, self.body)[0]
        return np.ptp(X, axis=0)


@dataclass(frozen=True)
class Shape:
    """mesh: corner nodes, mm, coarse where it is made here; size: mm, for the scene."""

    mesh: Mesh
    size: float

    @cached_property
    def interior(self) -> Interior:
        """Interior of the body."""
        return interior(self.mesh)

    @cached_property
    def voxels(self) -> Voxels:
        """Body as a lattice of cubes."""
        return voxels(self.interior, float(np.abs(self.mesh.volumes).sum()))

    @property
    def low(self) -> np.ndarray:
        """Size (3,) mm of the box around the body, along x, y and z."""
        return self.mesh.X.min(axis=0)

    @property
    def high(self) -> np.ndarray:
        """Size (3,) mm of the box around the body, along x, y and z."""
        return self.mesh.X.max(axis=0)

    @property
    def extent(self) -> np.ndarray:
        """Size (3,) mm of the box around the body, along x, y and z."""
        return self.high - self.low


def read_source(path: Path, remesh: bool = False, body: int = 1) -> Source:
    """remesh: take the surface of a mesh alone, as where it holds no more; body: of several that surfaces bound, the
    largest first. InputError where the file is missing, of no known kind, or holds no such closed body."""
    suffix = path.suffix.lower()
    if suffix not in FILES:
        raise InputError(
            f"a file of type '{suffix}' cannot be read as a shape", where=str(path), do=f"one of {' '.join(FILES)}"
        )
    demand_file(path)
    if suffix in MESH and not remesh:
        data = read_data(path)
        if any(block.dim == 3 for block in data.cells):
            mesh = read_own(path, 1.0)
            return Source(
                path, float(mesh.volumes.sum()), surface_area(mesh.X[mesh.facets]), mesh, False, mended(path, False)
            )
        remesh = True
    mends = mended(path, True, body) if suffix in SURFACES + MESH else ()
    volume, area, solids = measure_solids(solid_of(geometry(path, 1.0, remesh, body), Path()))
    if solids > 1:
        mends = (*mends, f"joined {solids} solids that touch: solid-1 to solid-{solids} in `materials` (--region)")
    return Source(path, volume, area, None, remesh, mends, body)


def geometry(path: Path, unit: float, remesh: bool = False, body: int = 1) -> StepFile | MeshFile:
    """Geometry of the scene that reads the file."""
    if path.suffix.lower() in STEP:
        return StepFile(kind="step", path=path)
    if path.suffix.lower() in BREP:
        return StepFile(kind="step", path=path, unit=f"{unit!r} mm")
    return MeshFile(kind="mesh-file", path=path, unit=f"{unit!r} mm", remesh=remesh, body=body)


def make_shape(source: Source, unit: float, cells: int) -> Shape:
    """unit: mm. Cells as large as a third of the body is thick on average, or larger, so that they are no more than
    half of `cells` and sizes graded from them have room. The size for the scene is smaller where the body is round.
    InputError where the body cannot be meshed."""
    if source.mesh is not None:
        mesh = replace(source.mesh, X=source.mesh.X * unit)
        return Shape(mesh, _two_digits((_REGULAR * mesh.volumes.mean()) ** (1 / 3)))
    volume, area = source.volume * unit**3, source.area * unit**2
    size = max(4 * volume / area / 3, (_REGULAR * volume / (cells / 2)) ** (1 / 3))
    for attempt in range(_ATTEMPTS):
        tried = _two_digits(size / 1.5**attempt)
        meshing = Meshing(size=f"{tried!r} mm", element="tet4")
        try:
            mesh, _ = corner_mesh(
                geometry(source.path, unit, source.remesh, source.body), meshing, [], Path(), "geometry"
            )
            return Shape(mesh, _two_digits(_faithful(tried, 1 - mesh.volumes.sum() / volume, volume, cells)))
        except InputError as error:  # too coarse a surface may intersect itself
            last = error
    raise last


def _faithful(size: float, missing: float, volume: float, cells: int) -> float:
    """mm: the size at which straight edges leave out _MISSING of the volume, as what they leave out goes with its
    square; so small at most that regular cells of it would be 1.6 times `cells` (gmsh makes 0.6 of those)."""
    smallest = (_REGULAR * volume / (1.6 * cells)) ** (1 / 3)
    return min(size, max(size * (_MISSING / max(missing, 1e-12)) ** 0.5, smallest))


def surface_area(corners: np.ndarray) -> float:
    """mm^2 of facets (k, 3 | 4, 3), a quadrilateral by its diagonals."""
    first = corners[:, 2] - corners[:, 0]
    second = corners[:, -1] - corners[:, 1]
    return float(np.linalg.norm(np.cross(first, second), axis=1).sum() / 2)


def _two_digits(value: float) -> float:
    return float(f"{value:.2g}")
