"""A finer mesh of the same scene, by which the discretisation error of the mesh at hand is estimated."""

from pathlib import Path

import numpy as np

from cfem.core.errors import SpecError
from cfem.mechanics.element import SECTIONED, barycentric_gradients, shape
from cfem.mechanics.mesh import Mesh, tet_volumes
from cfem.robot.geometry import Assembly, MeshFile
from cfem.robot.mesh.meshing import make_mesh, with_middles
from cfem.robot.shape.deform import shaped
from cfem.robot.spec import SceneSpec

# A tetrahedron as eight, by its corners (0 to 3) and the middles of its edges (4 to 9, in the order of TET_EDGES); the
# octahedron that is left at its centre is cut along the diagonal from 6 to 8.
_EIGHT = np.array(
    [[0, 4, 6, 7], [1, 5, 4, 8], [2, 6, 5, 9], [3, 8, 7, 9], [6, 8, 4, 5], [6, 8, 5, 9], [6, 8, 9, 7], [6, 8, 7, 4]]
)
_FOUR = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]])
_CELLS = 20  # nearest cells among which the one that holds a node is looked for


def dimensions(scene: SceneSpec) -> int:
    """Number of directions in which cells become smaller: one along a row of sections, else three."""
    return 1 if scene.mesh.element in SECTIONED else 3


def finer_mesh(scene: SceneSpec, mesh: Mesh, folder: Path) -> Mesh:
    """Mesh of cells half as large as those of `mesh`, that of `scene`. Tetrahedra are cut: what the mesh at hand cannot
    show is what cells within its own can show, whereas another mesh errs in its own way, by as much where a cable holds
    in a region smaller than a cell. Others are made anew. SpecError where a mesh file holds hexahedra."""
    if mesh.cells.shape[1] in (4, 10):
        finer = cut_in_eight(mesh.base)
        finer = with_middles(finer) if mesh.order == 2 else finer
        return finer if scene.shape is None else shaped(scene.shape, finer)
    if _cells_of_file(scene):
        raise SpecError("hexahedra of a mesh file are not cut")
    return make_mesh(_halved(scene), folder)[0]


def _cells_of_file(scene: SceneSpec) -> bool:
    """True if the cells are those of a mesh file, not made here."""
    return isinstance(scene.geometry, MeshFile) and not scene.geometry.meshed_here


def _halved(scene: SceneSpec) -> SceneSpec:
    """The scene with all its mesh sizes half as large."""
    update = {"mesh": scene.mesh.model_copy(update={"size": scene.mesh.size / 2})}
    if isinstance(scene.geometry, Assembly):
        parts = [part.model_copy(update={"size": part.size and part.size / 2}) for part in scene.geometry.parts]
        update["geometry"] = scene.geometry.model_copy(update={"parts": parts})
    return scene.model_copy(update=update)


def cut_in_eight(mesh: Mesh) -> Mesh:
    """Linear tetrahedra, eight for each of `mesh`, whose named sets they inherit."""
    parent = mesh if mesh.order == 2 else with_middles(mesh)
    children = parent.cells[:, _EIGHT].reshape(-1, 4)
    inverted = tet_volumes(parent.X, children) < 0
    children[inverted] = children[inverted][:, [0, 2, 1, 3]]
    facet_sets = {name: _parts_of(members, 4) for name, members in parent.facet_sets.items()}
    cell_sets = {name: _parts_of(members, 8) for name, members in parent.cell_sets.items()}
    facets = parent.facets[:, _FOUR].reshape(-1, 3)
    return Mesh(parent.X, children, facets, parent.node_sets, facet_sets, cell_sets)


def _parts_of(members: np.ndarray, parts: int) -> np.ndarray:
    """Indices of the parts that members, cut in `parts` each, have become."""
    return (parts * np.asarray(members)[:, None] + np.arange(parts)).ravel()


def carried_over(coarse: Mesh, x: np.ndarray, finer: Mesh) -> np.ndarray:
    """Positions (n, 3) mm of the nodes of `finer` under the deformation x of `coarse` tetrahedra, a start for Newton's
    method. A node that no cell holds follows the nearest cell's polynomial."""
    from scipy.spatial import cKDTree

    corners = coarse.X[coarse.cells[:, :4]]
    _, near = cKDTree(corners.mean(axis=1)).query(finer.X, k=min(_CELLS, len(corners)))
    gradients = barycentric_gradients(coarse.X, coarse.cells)[near]  # (n, k, 4, 3)
    offset = finer.X[:, None] - corners.mean(axis=1)[near]
    barycentric = 0.25 + np.einsum("nkad,nkd->nka", gradients, offset)
    best = barycentric.min(axis=2).argmax(axis=1)
    rows = np.arange(len(finer.X))
    weights = shape(coarse.cells.shape[1], barycentric[rows, best])
    return finer.X + np.einsum("na,nad->nd", weights, (x - coarse.X)[coarse.cells[near[rows, best]]])
