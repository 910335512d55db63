"""From a scene's geometry to its mesh, by gmsh in a process of its own or from the user's file."""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from cfem.core.errors import InputError, NumericalError
from cfem.mechanics.element import ELEMENTS
from cfem.mechanics.mesh import Mesh, boundary_facets, quadratic, tet_volumes
from cfem.robot.bar import bar
from cfem.robot.cad import File, Solid, as_data
from cfem.robot.mesh_file import read_tetrahedra
from cfem.robot.soft_finger import soft_finger
from cfem.robot.spec import Bar, MeshFile, Meshing, SceneSpec, SoftFinger

# What gmsh's wheel needs of a bare Debian (readelf -d on its library).
DEBIAN_PACKAGES = "libglu1-mesa libgl1 libgomp1 libxcursor1 libxft2 libxinerama1 libxfixes3 libxrender1 libfontconfig1"


def make_mesh(scene: SceneSpec, folder: Path) -> tuple[Mesh, float | None]:
    """The scene's mesh, and the CAD volume in mm^3 where there is one. Paths in the spec are relative to `folder`.

    Raises InputError (file, missing libraries), NumericalError (cannot be meshed)."""
    geometry = scene.geometry
    if isinstance(geometry, MeshFile) and geometry.path.suffix.lower() != ".stl":
        X, cells, node_sets = read_tetrahedra(folder / geometry.path, geometry.unit)
        volume = None
    else:
        X, cells, volume = run_gmsh(solid_of(scene, folder), scene.mesh)
        node_sets = {}
    inverted = tet_volumes(X, cells) < 0
    cells[inverted] = cells[inverted][:, [0, 2, 1, 3]]
    facets = boundary_facets(cells)
    if ELEMENTS[scene.mesh.element].order == 2:
        X, cells, facets = quadratic(X, cells, facets)
    return Mesh(X, cells, facets, node_sets), volume


def solid_of(scene: SceneSpec, folder: Path) -> Solid:
    """The scene's geometry as a tree of solids."""
    geometry = scene.geometry
    if isinstance(geometry, SoftFinger):
        return soft_finger(geometry)
    if isinstance(geometry, Bar):
        return bar(geometry)
    path = folder / geometry.path
    if not path.is_file():
        raise InputError("no such file", where=str(path), do="check geometry.path")
    return File(str(path), geometry.unit if isinstance(geometry, MeshFile) else 1.0)


def run_gmsh(solid: Solid, meshing: Meshing) -> tuple[np.ndarray, np.ndarray, float]:
    """X (n, 3) mm, cells (m, 4), CAD volume mm^3: the same for the same arguments."""
    refine = [
        {
            "low": part.corners.min(axis=0).tolist(),
            "high": part.corners.max(axis=0).tolist(),
            "size": part.size,
            "blend": part.blend,
        }
        for part in meshing.refine
    ]
    job = json.dumps({"solid": as_data(solid), "size": meshing.size, "refine": refine})
    with tempfile.TemporaryDirectory() as scratch:
        out = Path(scratch) / "mesh.npz"
        command = [sys.executable, "-m", "cfem.robot.gmsh_process", str(out)]
        done = subprocess.run(command, input=job, capture_output=True, text=True, check=False)
        cause = done.stderr.strip().splitlines()[-1] if done.stderr.strip() else f"exit {done.returncode}"
        if done.returncode == 10:
            raise InputError(f"gmsh cannot be loaded: {cause}", do=f"on Debian: apt-get install {DEBIAN_PACKAGES}")
        if done.returncode != 0:
            where = solid.path if isinstance(solid, File) else "geometry"
            kind = InputError if isinstance(solid, File) else NumericalError
            raise kind(f"cannot be meshed: {cause}", where=where, do="mend the geometry or change mesh.size")
        with np.load(out) as answer:
            return answer["X"], answer["cells"], float(answer["volume"])
