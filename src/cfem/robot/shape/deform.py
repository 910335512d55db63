"""The free form of a robot: its mesh with the nodes moved, the connectivity kept.

Each control point moves all of space around it by `move` times a bump of the distance, Wendland's function of
smoothness C4 (Adv. Comput. Math. 4, 1995), which is 1 at the point and 0 from `radius` on:

    bump(r) = (1 - r)^6 (35 r^2 + 18 r + 3) / 3

Walls move along the normals of their surface; the rest of the boundary stays, and the nodes between follow as an
elastic body does, as in morph.py. The nodes are a polynomial of all these moves and a smooth function of what the mesh
was before: no new mesh scatters what is computed on it."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from cfem.constraint.attachment import show
from cfem.constraint.cavity import enclosed
from cfem.core.errors import NumericalError, SpecError
from cfem.mechanics.mesh import Mesh
from cfem.robot.selection import facets_of
from cfem.robot.shape.elastic import middles, stiffness
from cfem.robot.shape.free_form import Control, FreeForm, WallThickness

THINNEST = 0.1  # of a cell's volume that must be left


def shaped(form: FreeForm, mesh: Mesh) -> Mesh:
    """The mesh of the geometry alone, deformed. NumericalError where a cell is inverted or nearly so."""
    return Deformation(form, mesh)(form, mesh)


class Deformation:
    """A free form that deforms meshes of one connectivity. mesh: of the geometry alone, whose elasticity carries
    walls."""

    def __init__(self, form: FreeForm, mesh: Mesh):
        self._surfaces = [_surface(wall, mesh, index) for index, wall in enumerate(form.walls)]
        self._edges = middles(mesh)
        self._inner = _Inner(mesh) if form.walls else None

    def __call__(self, form: FreeForm, mesh: Mesh) -> Mesh:
        """The mesh deformed by `form`, which has the same walls as the first. NumericalError as `shaped`."""
        X = mesh.X + displacement(form.controls, mesh.X)
        if self._inner is not None and any(wall.thicker for wall in form.walls):
            on_walls = sum(
                _growth(wall, mesh.X, facets) for wall, facets in zip(form.walls, self._surfaces, strict=True)
            )
            X += self._inner.extended(on_walls)
        X[self._edges[:, 0]] = (X[self._edges[:, 1]] + X[self._edges[:, 2]]) / 2
        deformed = replace(mesh, X=X, unshaped=mesh.X)
        left = deformed.volumes / mesh.volumes
        if not left.min() > THINNEST:
            raise _too_far(form, mesh, left)
        return deformed


def displacement(controls: Sequence[Control], points: np.ndarray) -> np.ndarray:
    """Displacements (k, 3) mm of points (k, 3) mm by the control points."""
    total = np.zeros_like(points, dtype=float)
    for control in controls:
        for place, move in _images(control):
            if move.any():
                total += bump(np.sqrt(((points - place) ** 2).sum(axis=1)) / control.radius)[:, None] * move
    return total


def bump(r: np.ndarray) -> np.ndarray:
    """Weight of a control point at distance r in radii: 1 at 0, and 0 from 1 on, twice differentiable."""
    left = np.maximum(1 - r, 0)
    return (left * left * left) ** 2 * ((35 * r + 18) * r + 3) / 3  # products: powers of arrays are slow


def _images(control: Control) -> list[tuple[np.ndarray, np.ndarray]]:
    """Place and move of a control point, and of its mirror image."""
    place, move = np.asarray(control.at, float), np.asarray(control.move, float)
    if control.mirror is None:
        return [(place, move)]
    flip = np.where(np.arange(3) == "xyz".index(control.mirror), -1.0, 1.0)
    return [(place, move), (flip * place, flip * move)]


def _surface(wall: WallThickness, mesh: Mesh, index: int) -> np.ndarray:
    """Facets (k, 3 | 4 | 6) of the wall's surface. SpecError where there is none."""
    where = f"shape.walls.{index}"
    if wall.surface is not None:
        return facets_of(mesh, wall.surface, f"{where}.surface")
    try:
        return mesh.facets[enclosed(mesh, wall.inside, f"wall {index}")]
    except SpecError as error:
        raise SpecError(error.what, where=f"{where}.inside", do=error.do) from None


def _growth(wall: WallThickness, X: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """Displacements (n, 3) mm of the corners of a wall's surface along its normals, which point into the void."""
    corners = facets[:, :4] if facets.shape[1] == 4 else facets[:, :3]
    a, b, c, d = (X[corners[:, i]] for i in (0, 1, 2, -1))
    area = np.cross(c - a, d - b) if corners.shape[1] == 4 else np.cross(b - a, c - a)
    normals = np.zeros_like(X)
    for column in corners.T:
        np.add.at(normals, column, area)
    nodes = np.unique(corners)
    normals[nodes] /= np.linalg.norm(normals[nodes], axis=1)[:, None]
    return wall.thicker * bump(np.linalg.norm(X - wall.at, axis=1) / wall.radius)[:, None] * normals


class _Inner:
    """The inner corners of a mesh of tetrahedra, which follow its boundary."""

    def __init__(self, mesh: Mesh):
        """Factors the elastic stiffness of the free corners. SpecError where the cells are hexahedra."""
        if mesh.cells.shape[1] == 8:
            raise SpecError("walls of hexahedra cannot change", where="shape.walls", do="mesh with tetrahedra")
        self._corners = np.unique(mesh.cells[:, :4])
        outer = np.isin(self._corners, mesh.facets[:, :3])
        K = sp.csc_matrix(stiffness(mesh))
        free = np.repeat(~outer, 3)
        self._free, self._coupled = free, K[free][:, ~free]
        self._factor = splu(K[free][:, free]) if free.any() else None

    def extended(self, moves: np.ndarray) -> np.ndarray:
        """Displacements (n, 3) of all corners, given those of the boundary."""
        total = moves.copy()
        if self._factor is not None:
            known = moves[self._corners].ravel()
            known[self._free] = self._factor.solve(-(self._coupled @ known[~self._free]))
            total[self._corners] = known.reshape(-1, 3)
        return total


def _too_far(form: FreeForm, mesh: Mesh, left: np.ndarray) -> NumericalError:
    """Error that names the control point or wall next to the thinnest cell. left (m,): shares of the volumes left."""
    cell = int(left.argmin())
    place = mesh.X[mesh.cells[cell, :4]].mean(axis=0)
    places = [
        (f"shape.controls.{i}", image) for i, control in enumerate(form.controls) for image, _ in _images(control)
    ]
    places += [(f"shape.walls.{i}", np.asarray(wall.at)) for i, wall in enumerate(form.walls)]
    name, _ = min(places, key=lambda named: float(np.linalg.norm(named[1] - place)))
    what = f"the free form leaves a cell at {show(np.round(place, 2))} mm with {left[cell]:.2g} of its volume"
    return NumericalError(what, where=name, do="move it less, or give it a larger radius")
