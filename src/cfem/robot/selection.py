"""Selection of a part of a mesh: boxes, balls, cylinders, half spaces, or sets by name. Coordinates are the scene's."""

from collections.abc import Sequence
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, Field

from cfem.core.errors import SpecError
from cfem.core.spec import Spec
from cfem.core.units import Length, Point, Points
from cfem.mechanics.mesh import TET_EDGES, TET_FACES, TRIANGLE_EDGES, Mesh


def _place(point: Sequence[float]) -> str:
    return f"({', '.join(f'{number:g}' for number in point)})"


def _directed(value: list[float]) -> list[float]:
    if not any(value) or not np.isfinite(value).all():
        raise ValueError(f"expected a direction, not {_place(value)}")
    return value


Direction = Annotated[list[float], Field(min_length=3, max_length=3), AfterValidator(_directed)]


class Box(Spec):
    """All points between two opposite corners."""

    kind: Literal["box"]
    """A box."""
    corners: Points
    """Two opposite corners."""

    @property
    def low(self) -> np.ndarray:
        return self.corners.min(axis=0)

    @property
    def high(self) -> np.ndarray:
        return self.corners.max(axis=0)

    @property
    def words(self) -> str:
        """The box in words."""
        return f"box from {_place(self.low)} to {_place(self.high)} mm"

    @property
    def flat(self) -> int | None:
        """Axis across which the box has no thickness; None where there is none, or more than one."""
        axes = np.flatnonzero(self.high == self.low)
        return int(axes[0]) if len(axes) == 1 else None


class Sphere(Spec):
    """All points within a ball."""

    kind: Literal["sphere"]
    """A ball."""
    centre: Point
    """Centre of the ball."""
    radius: Length = Field(gt=0)
    """Radius of the ball."""

    @property
    def words(self) -> str:
        """The ball in words."""
        return f"ball of {self.radius:g} mm about {_place(self.centre)} mm"


class Plane(Spec):
    """All points on a plane or beyond it."""

    kind: Literal["plane"]
    """A half space."""
    point: Point
    """A point of the plane."""
    normal: Direction
    """Direction, x, y and z, in which the selected side lies."""

    @property
    def words(self) -> str:
        """The half space in words."""
        return f"beyond {_place(self.point)} mm towards {_place(self.normal)}"


class Cylinder(Spec):
    """All points within a distance of an axis without ends, or beyond it."""

    kind: Literal["cylinder"]
    """Around an axis."""
    point: Point
    """A point of the axis."""
    direction: Direction
    """Direction of the axis, x, y and z."""
    radius: Length = Field(gt=0)
    """Distance from the axis."""
    side: Literal["inside", "outside"] = "inside"
    """Which points are meant."""

    @property
    def words(self) -> str:
        """The cylinder in words."""
        axis = f"{self.radius:g} mm from the axis through {_place(self.point)} mm along {_place(self.direction)}"
        return f"{'within' if self.side == 'inside' else 'beyond'} {axis}"


class Named(Spec):
    """A node, facet or cell set of the mesh: a physical group of the mesh file, or a part of an assembly."""

    kind: Literal["name"]
    """A set by its name."""
    name: str
    """Name of the set."""

    @property
    def words(self) -> str:
        """Name of the set."""
        return self.name


Shape = Box | Sphere | Plane | Cylinder
Selection = Annotated[Shape | Named, Field(discriminator="kind")]


def select_nodes(mesh: Mesh, selection: Shape | Named, where: str) -> np.ndarray:
    """Indices of the nodes meant, ascending. SpecError, naming `where`, if there are none."""
    if isinstance(selection, Named):
        chosen = np.zeros(len(mesh.X), dtype=bool)
        chosen[_named_nodes(mesh, selection.name, where)] = True
    else:
        chosen = _inside(mesh.X, selection, 1e-6 * mesh.size)
    return _some(chosen, selection, where, "node")


def select_cells(mesh: Mesh, selection: Shape | Named, where: str) -> np.ndarray:
    """Indices of the cells meant, ascending: those whose centroid lies inside, or a cell set. SpecError, naming
    `where`, if there are none."""
    if isinstance(selection, Named):
        return cells_of(mesh, selection.name, where)
    corners = mesh.cells[:, : 8 if mesh.cells.shape[1] == 8 else 4]
    centroids = mesh.X[corners].mean(axis=1)
    return _some(_inside(centroids, selection, 1e-6 * mesh.size), selection, where, "cell")


def cells_of(mesh: Mesh, name: str, where: str) -> np.ndarray:
    """The cell set `name`. SpecError, naming `where` and the sets that there are."""
    if name not in mesh.cell_sets:
        raise _unknown(where, "cell set", name, mesh.cell_sets)
    return np.sort(mesh.cell_sets[name])


def facets_of(mesh: Mesh, name: str, where: str) -> np.ndarray:
    """The nodes (k, 3 | 6 | 4) of the facets in the set `name`. SpecError, naming `where` and the sets there are."""
    if name not in mesh.facet_sets:
        raise _unknown(where, "facet set", name, mesh.facet_sets)
    return mesh.facets[mesh.facet_sets[name]]


def select_faces(mesh: Mesh, selection: Shape | Named, where: str) -> np.ndarray:
    """Nodes (k, 3 | 6) of the faces meant: of the surface all of whose nodes lie inside, or a facet set; of a box
    without thickness those of tetrahedra in the body too, normals along its axis there. SpecError, naming `where`, if
    there are none."""
    if isinstance(selection, Named):
        return facets_of(mesh, selection.name, where)
    inside = _inside(mesh.X, selection, 1e-6 * mesh.size)
    chosen = mesh.facets[inside[mesh.facets].all(axis=1)]
    if isinstance(selection, Box) and selection.flat is not None:
        chosen = np.concatenate([chosen, _faces_within(mesh, inside, selection.flat)])
    if not len(chosen):
        message = f"the {selection.kind} selects no face of the mesh"
        raise SpecError(message, where=where, do="check its coordinates and units")
    return chosen


def _faces_within(mesh: Mesh, inside: np.ndarray, axis: int) -> np.ndarray:
    """Nodes (k, 3 | 6) of the faces between two tetrahedra whose corners are all `inside` (n,), each once, normals
    along the axis."""
    cell, face = np.nonzero(inside[mesh.cells[:, TET_FACES]].all(axis=2))
    local = TET_FACES[face]
    if mesh.order == 2:
        pairs = np.sort(local[:, TRIANGLE_EDGES], axis=2)
        middle = 4 + (pairs[:, :, None] == np.sort(TET_EDGES, axis=1)).all(axis=3).argmax(axis=2)
        local = np.hstack([local, middle])
    faces = mesh.cells[cell[:, None], local]
    a, b, c = mesh.X[faces[:, :3]].swapaxes(0, 1)
    _, number, count = np.unique(np.sort(faces[:, :3], axis=1), axis=0, return_inverse=True, return_counts=True)
    return faces[(count[number.ravel()] == 2) & (np.cross(b - a, c - a)[:, axis] > 0)]


def _named_nodes(mesh: Mesh, name: str, where: str) -> np.ndarray:
    if name in mesh.node_sets:
        return mesh.node_sets[name]
    if name in mesh.facet_sets:
        return mesh.facets[mesh.facet_sets[name]]
    if name in mesh.cell_sets:
        return mesh.cells[mesh.cell_sets[name]]
    raise _unknown(where, "set", name, {*mesh.node_sets, *mesh.facet_sets, *mesh.cell_sets})


def _inside(points: np.ndarray, shape: Shape, slack: float) -> np.ndarray:
    """Mask (k,) of the points (k, 3) that lie in the shape, or within `slack` mm of it."""
    if isinstance(shape, Box):
        return ((shape.low - slack <= points) & (shape.high + slack >= points)).all(axis=1)
    if isinstance(shape, Sphere):
        return np.linalg.norm(points - shape.centre, axis=1) <= shape.radius + slack
    if isinstance(shape, Cylinder):
        away = np.linalg.norm(np.cross(points - shape.point, shape.direction), axis=1)
        away /= np.linalg.norm(shape.direction)
        return away <= shape.radius + slack if shape.side == "inside" else away >= shape.radius - slack
    normal = np.asarray(shape.normal)
    return (points - shape.point) @ normal >= -slack * np.linalg.norm(normal)


def _some(chosen: np.ndarray, selection: Shape | Named, where: str, what: str) -> np.ndarray:
    if not chosen.any():
        message = f"the {selection.kind} selects no {what} of the mesh"
        raise SpecError(message, where=where, do="check its coordinates and units")
    return np.flatnonzero(chosen)


def _unknown(where: str, what: str, name: str, known) -> SpecError:
    return SpecError(f"the mesh has no {what} '{name}'", where=where, do=f"it has {', '.join(sorted(known)) or 'none'}")


def rigid_groups(mesh: Mesh, selections: Sequence[Selection], fixed: np.ndarray) -> tuple[np.ndarray, ...]:
    """Node indices of each rigid body. SpecError where a group has no three nodes off a line, shares nodes with
    another, or is held by `fixed` nodes."""
    groups = tuple(select_nodes(mesh, selection, f"rigid.{index}") for index, selection in enumerate(selections))
    for index, nodes in enumerate(groups):
        across = np.linalg.svd(mesh.X[nodes] - mesh.X[nodes].mean(axis=0), compute_uv=False)
        if len(nodes) < 3 or across[1] < 1e-6 * mesh.size:
            raise SpecError(
                f"{len(nodes)} nodes, all on one line, do not make a rigid body",
                where=f"rigid.{index}",
                do="select at least three nodes that are not on a line",
            )
        if (shared := np.intersect1d(nodes, fixed)).size:
            raise SpecError(
                f"shares {shared.size} of its {nodes.size} nodes with fixed",
                where=f"rigid.{index}",
                do="either list the whole of it under fixed, or select it apart from what is fixed",
            )
        for before in range(index):
            if (shared := np.intersect1d(nodes, groups[before])).size:
                raise SpecError(
                    f"shares {shared.size} nodes with rigid.{before}",
                    where=f"rigid.{index}",
                    do="make one group of the two, or select them apart",
                )
    return groups
