"""Which part of a mesh is meant: boxes, balls, half spaces, or sets that the mesh file names."""

from typing import Literal

import numpy as np
from pydantic import Field, field_validator

from cfem.core.errors import SpecError
from cfem.core.spec import Spec
from cfem.core.units import Length, Point, Points
from cfem.mechanics.mesh import Mesh


class Box(Spec):
    """All points between two opposite corners."""

    kind: Literal["box"]
    corners: Points


class Sphere(Spec):
    """All points within a ball."""

    kind: Literal["sphere"]
    centre: Point
    radius: Length


class Plane(Spec):
    """All points on or beyond a plane, on the side that `normal` points to."""

    kind: Literal["plane"]
    point: Point
    normal: list[float] = Field(min_length=3, max_length=3)

    @field_validator("normal")
    @classmethod
    def _directed(cls, value: list[float]) -> list[float]:
        if not any(value):
            raise ValueError("expected a direction, not (0, 0, 0)")
        return value


class Named(Spec):
    """A node or facet set (physical group) of the mesh file."""

    kind: Literal["name"]
    name: str


Selection = Box | Sphere | Plane | Named


def select_nodes(mesh: Mesh, selection: Selection, where: str) -> np.ndarray:
    """Indices of the nodes meant, ascending. SpecError, naming `where`, if there are none."""
    nodes = np.flatnonzero(_chosen(mesh, selection, where))
    if len(nodes) == 0:
        raise SpecError(
            f"{where}: the {selection.kind} selects no node of the mesh", do="check its coordinates and units"
        )
    return nodes


def _chosen(mesh: Mesh, selection: Selection, where: str) -> np.ndarray:
    slack = 1e-6 * mesh.size
    if isinstance(selection, Box):
        low, high = selection.corners.min(axis=0), selection.corners.max(axis=0)
        return ((low - slack <= mesh.X) & (high + slack >= mesh.X)).all(axis=1)
    if isinstance(selection, Sphere):
        return np.linalg.norm(mesh.X - selection.centre, axis=1) <= selection.radius + slack
    if isinstance(selection, Plane):
        normal = np.asarray(selection.normal)
        return (mesh.X - selection.point) @ normal >= -slack * np.linalg.norm(normal)
    chosen = np.zeros(len(mesh.X), dtype=bool)
    if selection.name in mesh.node_sets:
        chosen[mesh.node_sets[selection.name]] = True
    elif selection.name in mesh.facet_sets:
        chosen[mesh.facets[mesh.facet_sets[selection.name]]] = True
    else:
        known = sorted({*mesh.node_sets, *mesh.facet_sets})
        raise SpecError(f"{where}: the mesh has no set '{selection.name}'", do=f"it has {known}")
    return chosen
