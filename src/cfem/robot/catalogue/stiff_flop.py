"""The STIFF-FLOP trunk as slices of hexahedra between plane sections, and what its sections amount to.

A section of six sectors is either whole, twelve quadrilaterals around each chamber, or a bare tube, where the
hexahedra only carry pictures and attachments."""

from dataclasses import dataclass, replace
from math import cos, pi
from typing import Literal

import numpy as np
from pydantic import Field, PositiveInt

from cfem.core.spec import Spec
from cfem.core.units import Length
from cfem.mechanics.mesh import Mesh
from cfem.robot.catalogue.sections import sections_of, sliced_mesh

CHAMBERS, SIDES = 6, 12
# A polygon of twelve sides as five quadrilaterals.
_LID = np.array([[i, i + 1, 10 - i, 11 - i] for i in range(5)])


class StiffFlop(Spec):
    """Modules in a row from x = 0 along x, each with a bore and six chambers around it (the STIFF-FLOP trunk of Navez,
    Menager et al. 2025). Chamber k lies at k times 60 deg from the y axis towards z. Circles are polygons of twelve
    sides. The sections do not deform, as with fibres around the body. The robot is meshed into slices of mesh.size
    along x. Defaults are the paper's."""

    kind: Literal["stiff-flop"]
    """The pneumatic trunk of one or more modules."""
    modules: PositiveInt = 2
    """Number of modules."""
    module_length: Length = Field(default=55.0, gt=0)
    """Length of one module."""
    radius: Length = Field(default=5.75, gt=0)
    """Outer radius."""
    bore_radius: Length = Field(default=2.25, gt=0)
    """Radius of the bore."""
    chamber_radius: Length = Field(default=0.75, gt=0)
    """Radius of a chamber."""
    chamber_circle: Length = Field(default=4.0, gt=0)
    """Radius of the circle on which the chambers' centres lie."""

    def check(self) -> None:
        wall = self.chamber_circle - self.chamber_radius
        if not self.bore_radius < wall or not self.chamber_circle + self.chamber_radius < self.radius * cos(pi / 12):
            raise ValueError("the chambers must lie between bore_radius and radius")


@dataclass(frozen=True)
class Layout:
    """A section cut into quadrilaterals."""

    points: np.ndarray  # (k, 2) mm, y and z
    quads: np.ndarray  # (f, 4) of the points, counterclockwise seen from the tip
    rings: np.ndarray  # (6, 12): the chambers' walls likewise; none in a bare tube


def slice_mesh(geometry: StiffFlop, element: str, size: float) -> Mesh:
    """Mesh of sections at most `size` mm apart, each a node set; each module is a set of cells, module-1 at the
    base."""
    section = layout(geometry, bare=element == "beam")
    slices = int(np.ceil(geometry.module_length / size - 1e-9))
    places = np.linspace(0.0, geometry.modules * geometry.module_length, geometry.modules * slices + 1)
    points = section.points
    mesh = sliced_mesh([np.column_stack([np.full(len(points), x), points]) for x in places], section.quads)
    cells = len(mesh.cells) // geometry.modules
    modules = {f"module-{number + 1}": cells * number + np.arange(cells) for number in range(geometry.modules)}
    return replace(mesh, cell_sets=modules)


def plates_of(geometry: StiffFlop, mesh: Mesh) -> list[np.ndarray]:
    """Node indices of the sections between which the modules lie."""
    return sections_of(mesh)[:: _slices_per_module(geometry, mesh)]


def _slices_per_module(geometry: StiffFlop, mesh: Mesh) -> int:
    return (len(sections_of(mesh)) - 1) // geometry.modules


def windings(geometry: StiffFlop, mesh: Mesh) -> tuple[np.ndarray, ...]:
    """Nodes of each rigid group of a solid: the plate at the end of each module, and around each chamber a hoop in
    every other section but the base."""
    rings, slices = layout(geometry, bare=False).rings, _slices_per_module(geometry, mesh)
    groups = []
    for number, nodes in enumerate(sections_of(mesh)[1:], 1):
        groups += [nodes] if number % slices == 0 else [nodes[ring] for ring in rings]
    return tuple(groups)


def chamber_area(geometry: StiffFlop) -> float:
    """Area mm^2 of the section of one chamber."""
    return polygon(geometry.chamber_radius)[0]


def chamber_centres(geometry: StiffFlop, chambers: list[int]) -> np.ndarray:
    """Centres (k, 2) mm of chambers, y and z."""
    return geometry.chamber_circle * _directions(np.asarray(chambers) * 2 * np.pi / CHAMBERS)


def module_elements(geometry: StiffFlop, mesh: Mesh, module: int) -> np.ndarray:
    """Indices of the slices of a module, 1 at the base."""
    slices = _slices_per_module(geometry, mesh)
    return (module - 1) * slices + np.arange(slices)


def chamber_surface(geometry: StiffFlop, mesh: Mesh, module: int, chambers: list[int]) -> np.ndarray:
    """Facets (g, 4) of the closed walls of chambers along a module, normals outward."""
    rings, sections = layout(geometry, bare=False).rings, sections_of(mesh)
    elements = module_elements(geometry, mesh, module)
    facets = []
    for chamber in chambers:
        ring = rings[chamber]
        low, high = sections[elements[0]][ring], sections[elements[-1] + 1][ring]
        facets += [low[_LID][:, ::-1], high[_LID]]
        for number in elements:
            a, b = sections[number][ring], sections[number + 1][ring]
            facets.append(np.column_stack([a, np.roll(a, -1), np.roll(b, -1), b]))
    return np.concatenate(facets)


def layout(geometry: StiffFlop, bare: bool) -> Layout:
    """Quadrilaterals of one section, with holes for its chambers or as a bare tube."""
    angles = np.arange(SIDES) * 2 * np.pi / SIDES
    bore, outer = geometry.bore_radius * _directions(angles), geometry.radius * _directions(angles)
    around = np.arange(SIDES)
    if bare:
        quads = np.column_stack([around, SIDES + around, SIDES + np.roll(around, -1), np.roll(around, -1)])
        return Layout(np.concatenate([bore, outer]), quads, np.zeros((0, SIDES), dtype=int))
    # between two sectors three points on a ray, at quarters of the wall
    steps = geometry.bore_radius + (geometry.radius - geometry.bore_radius) * np.array([1, 2, 3]) / 4
    rays = np.concatenate([steps[:, None] * ray for ray in _directions(angles[1::2])])
    holes = np.concatenate(
        [
            centre + geometry.chamber_radius * _directions(angles)
            for centre in chamber_centres(geometry, range(CHAMBERS))
        ]
    )
    points, first_ray, first_hole = np.concatenate([bore, outer, rays, holes]), 2 * SIDES, 2 * SIDES + 3 * CHAMBERS
    rings = np.empty((CHAMBERS, SIDES), dtype=int)
    quads = []
    for k in range(CHAMBERS):
        # the sector's outline: out on the circle, in along one ray, back on the bore, out along the ray before
        corner, after, before = 2 * k, (2 * k + 1) % SIDES, (2 * k - 1) % SIDES
        ray_after, ray_before = first_ray + 3 * k, first_ray + 3 * ((k - 1) % CHAMBERS)
        rim = [SIDES + corner, SIDES + after, ray_after + 2, ray_after + 1, ray_after, after]
        rim += [corner, before, ray_before, ray_before + 1, ray_before + 2, SIDES + before]
        # the hole's corner that looks outward first, whatever the sector
        ring = first_hole + SIDES * k + (around + 2 * k) % SIDES
        rings[k] = ring
        rim = np.array(rim)
        quads.append(np.column_stack([ring, rim, np.roll(rim, -1), np.roll(ring, -1)]))
    return Layout(points, np.concatenate(quads), rings)


def _directions(angles: np.ndarray) -> np.ndarray:
    return np.column_stack([np.cos(angles), np.sin(angles)])


def polygon(radius: float) -> tuple[float, float]:
    """Area and second moment about an axis through the middle of a regular polygon with corners at `radius`."""
    angle = 2 * np.pi / SIDES
    area = SIDES / 2 * radius**2 * np.sin(angle)
    return float(area), float(area * radius**2 * (2 + np.cos(angle)) / 12)
