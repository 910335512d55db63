"""The STIFF-FLOP trunk as slices of hexahedra between plane sections, and what its sections amount to.

A section of six sectors is either whole, twelve quadrilaterals around each chamber, or a bare tube, where the
hexahedra only carry pictures and attachments."""

from dataclasses import dataclass

import numpy as np

from cfem.mechanics.mesh import Mesh, boundary_facets
from cfem.mechanics.rod.region import CrossSection
from cfem.robot.geometry import StiffFlop

CHAMBERS, SIDES = 6, 12
_SECTION = "section-"
# A polygon of twelve sides as five quadrilaterals.
_LID = np.array([[i, i + 1, 10 - i, 11 - i] for i in range(5)])


@dataclass(frozen=True)
class Layout:
    """points (k, 2) mm, y and z; quads (f, 4) of them, counterclockwise seen from the tip; rings (6, 12): the chambers'
    walls likewise, none in a bare tube."""

    points: np.ndarray
    quads: np.ndarray
    rings: np.ndarray


def slice_mesh(geometry: StiffFlop, element: str, size: float) -> Mesh:
    """Sections, each a node set, at most `size` mm apart; each module is a set of cells, module-1 at the base."""
    made = layout(geometry, bare=element == "beam")
    slices = int(np.ceil(geometry.module_length / size - 1e-9))
    places = np.linspace(0.0, geometry.modules * geometry.module_length, geometry.modules * slices + 1)
    k = len(made.points)
    X = np.concatenate([np.column_stack([np.full(k, x), made.points]) for x in places])
    q = made.quads
    first = np.column_stack([q[:, 0], q[:, 0] + k, q[:, 1] + k, q[:, 1], q[:, 3], q[:, 3] + k, q[:, 2] + k, q[:, 2]])
    cells = np.concatenate([first + k * number for number in range(len(places) - 1)])
    node_sets = {f"{_SECTION}{number:03d}": k * number + np.arange(k) for number in range(len(places))}
    each = slices * len(q)
    cell_sets = {f"module-{number + 1}": each * number + np.arange(each) for number in range(geometry.modules)}
    return Mesh(X, cells, boundary_facets(cells), node_sets, {}, cell_sets)


def sections_of(mesh: Mesh) -> list[np.ndarray]:
    """Node indices of each section, from the base on."""
    return [np.sort(mesh.node_sets[name]) for name in sorted(mesh.node_sets) if name.startswith(_SECTION)]


def plates_of(geometry: StiffFlop, mesh: Mesh) -> list[np.ndarray]:
    """Node indices of the sections between which the modules lie."""
    sections = sections_of(mesh)
    return sections[:: (len(sections) - 1) // geometry.modules]


def windings(geometry: StiffFlop, mesh: Mesh) -> tuple[np.ndarray, ...]:
    """What is rigid of a solid, but its base: the plate at the end of each module, and around each chamber a hoop of
    nodes in every other section."""
    rings, sections = layout(geometry, bare=False).rings, sections_of(mesh)
    each = (len(sections) - 1) // geometry.modules
    groups = []
    for number, nodes in enumerate(sections[1:], 1):
        groups += [nodes] if number % each == 0 else [nodes[ring] for ring in rings]
    return tuple(groups)


def section_shape(geometry: StiffFlop) -> CrossSection:
    """Of the polygons; J = 2 I, as plane sections that do not warp have."""
    outer, bore, chamber = (
        _polygon(radius) for radius in (geometry.radius, geometry.bore_radius, geometry.chamber_radius)
    )
    area = outer[0] - bore[0] - CHAMBERS * chamber[0]
    # six equal areas on a circle have half of their polar moment about either axis
    bending = outer[1] - bore[1] - CHAMBERS * (chamber[1] + chamber[0] * geometry.chamber_circle**2 / 2)
    return CrossSection(area, bending, 2 * bending)


def chamber_area(geometry: StiffFlop) -> float:
    """mm^2."""
    return _polygon(geometry.chamber_radius)[0]


def chamber_centres(geometry: StiffFlop, chambers: list[int]) -> np.ndarray:
    """(k, 2) mm, y and z."""
    return geometry.chamber_circle * _directions(np.asarray(chambers) * 2 * np.pi / CHAMBERS)


def module_elements(geometry: StiffFlop, mesh: Mesh, module: int) -> np.ndarray:
    """Indices of the slices of a module, 1 at the base."""
    slices = (len(sections_of(mesh)) - 1) // geometry.modules
    return (module - 1) * slices + np.arange(slices)


def chamber_surface(geometry: StiffFlop, mesh: Mesh, module: int, chambers: list[int]) -> np.ndarray:
    """(g, 4) facets, closed, normals outward, of chambers along a module."""
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
    """Of one section."""
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
        here, after, before = 2 * k, (2 * k + 1) % SIDES, (2 * k - 1) % SIDES
        ray_after, ray_before = first_ray + 3 * k, first_ray + 3 * ((k - 1) % CHAMBERS)
        rim = [SIDES + here, SIDES + after, ray_after + 2, ray_after + 1, ray_after, after]
        rim += [here, before, ray_before, ray_before + 1, ray_before + 2, SIDES + before]
        # the hole's corner that looks outward first, whatever the sector
        ring = first_hole + SIDES * k + (around + 2 * k) % SIDES
        rings[k] = ring
        rim = np.array(rim)
        quads.append(np.column_stack([ring, rim, np.roll(rim, -1), np.roll(ring, -1)]))
    return Layout(points, np.concatenate(quads), rings)


def _directions(angles: np.ndarray) -> np.ndarray:
    return np.column_stack([np.cos(angles), np.sin(angles)])


def _polygon(radius: float) -> tuple[float, float]:
    """Area and second moment about an axis through the middle of a regular polygon with corners at `radius`."""
    angle = 2 * np.pi / SIDES
    area = SIDES / 2 * radius**2 * np.sin(angle)
    return float(area), float(area * radius**2 * (2 + np.cos(angle)) / 12)
