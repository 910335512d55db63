"""A body: all its elastic regions on one set of nodes; sums of what they give.

A body is whatever gives energy, internal force and tangent on its nodes; several robots in one scene are one body in
several pieces."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cfem.core.console.shown import counted
from cfem.core.errors import InputError
from cfem.mechanics import layer as membrane
from cfem.mechanics import self_contact as walls
from cfem.mechanics import solid as region
from cfem.mechanics.element import Element, reference_gradients
from cfem.mechanics.layer import Fabric, Layer, LayerResponse
from cfem.mechanics.material.law import Material
from cfem.mechanics.mesh import Mesh
from cfem.mechanics.rod import region as rods
from cfem.mechanics.rod.region import CrossSection, Rod, RodResponse
from cfem.mechanics.rod.sections import Sections
from cfem.mechanics.self_contact import SelfContact, SelfContactResponse
from cfem.mechanics.solid import Solid, make_solid

# Laws of rubber, whose fibres a rod that may contract takes for neo-Hookean.
RUBBER = ("neo-hookean", "neo-hookean-log", "mooney-rivlin", "ogden")
# The bubbles' own equilibrium is not found where the bulk modulus is some thousand times the shear modulus.
_STIFFEST_WITH_BUBBLES = 0.499


@dataclass(frozen=True)
class Body:
    """The elastic regions on one set of nodes.

    mesh: at rest
    element: whose nodes the mesh has
    solids: its regions
    cells: (m, n_nodes) of all of them, one region after the other: the order of element pressures
    sections: rigid ones in a row, where the body is of these
    rod: that joins them
    layers: on faces of the cells
    contact: of its surface with itself"""

    mesh: Mesh
    element: Element
    solids: tuple[Solid, ...]
    sections: Sections | None = None
    rod: Rod | None = None
    layers: tuple[Layer, ...] = ()
    contact: SelfContact | None = None

    @property
    def cells(self) -> np.ndarray:
        return np.concatenate([self.mesh.cells[:0], *(part.cells for part in self.solids)])

    @property
    def cliques(self) -> tuple[np.ndarray, ...]:
        """Groups (m, k) of nodes that the tangent couples."""
        return (self.cells,) if self.contact is None else (self.cells, self.contact.nodes)

    @property
    def shear(self) -> float:
        """Smallest shear modulus at rest, MPa."""
        stiff = [] if self.rod is None else [float(self.rod.shear.min())]
        return min([part.shear for part in self.solids] + stiff)

    @property
    def n_pressures(self) -> int:
        return sum(len(part.cells) for part in self.solids) if self.element.pressure else 0

    def parts(self) -> list[tuple[Solid, slice]]:
        """Regions, each with the slice of the body's element pressures that belongs to it."""
        ends = np.cumsum([0] + [len(part.cells) for part in self.solids])
        return [(part, slice(a, b)) for part, a, b in zip(self.solids, ends[:-1], ends[1:], strict=True)]


@dataclass(frozen=True)
class BodyResponse:
    """Response of a body at positions x and element pressures p.

    energy: N mm
    force: (n, 3) N internal of the solids, layers and contact, with the given p
    mismatch, pressure, min_J: (m,) MPa and number as of its regions (solid.py), min_J 0 or less also where sections of
    the rod touch
    rod: its own response, whose forces act on the sections' frames (rod/region.py)"""

    energy: float
    force: np.ndarray
    mismatch: np.ndarray
    pressure: np.ndarray
    min_J: float
    solids: tuple[region.SolidResponse, ...]
    rod: RodResponse | None = None
    layers: tuple[LayerResponse, ...] = ()
    contact: SelfContactResponse | None = None


def make_body(
    mesh: Mesh,
    element: Element,
    material: Material,
    regions: Sequence[tuple[np.ndarray, Material]] = (),
) -> Body:
    """Body whose cells are all of `material`, but those of the regions (cell indices, material), of which later ones
    win.

    Raises InputError where a cell is inverted or flat, a node is in no cell, or a number is not finite."""
    if not np.isfinite(mesh.X).all():
        raise InputError(
            "the mesh has nodes whose coordinates are not finite numbers", do="mesh it again, with another size"
        )
    unused = len(mesh.X) - len(np.unique(mesh.cells))
    if unused:
        raise InputError(
            f"{unused} of {len(mesh.X)} nodes of the mesh {'belongs' if unused == 1 else 'belong'} to no cell",
            do="drop them",
        )
    materials, owner = _assigned(mesh, element, material, regions)
    try:
        solids = tuple(
            make_solid(mesh.X, np.ascontiguousarray(mesh.cells[owner == number]), element, materials[number], number)
            for number in np.unique(owner).tolist()
        )
        bad = sum(int((~(part.weights > 0)).any(axis=1).sum()) for part in solids)
    except np.linalg.LinAlgError:
        bad = int((mesh.volumes == 0).sum())
    if bad:
        raise InputError(
            f"{bad} of the mesh's {counted(len(mesh.cells), 'cell')} {'is' if bad == 1 else 'are'} inverted or flat",
            do="mesh it again, with another size",
        )
    return Body(mesh, element, solids)


def with_layers(body: Body, faces: Sequence[tuple[np.ndarray, Fabric]]) -> Body:
    """The body of tetrahedra with layers on faces (k, 3 | 6). InputError where a face is none of a cell, or fibres are
    normal to it."""
    X, cells = body.mesh.X, body.cells
    return replace(body, layers=tuple(membrane.make_layer(X, cells, facets, fabric) for facets, fabric in faces))


def make_rod_body(
    mesh: Mesh,
    element: Element,
    sections: Sections,
    shape: CrossSection,
    material: Material,
    regions: Sequence[tuple[np.ndarray, Material]] = (),
) -> Body:
    """A rod of sections of that shape; materials as in `make_body`, an element's that of most cells around it."""
    materials, owner = _assigned(mesh, element, material, regions)
    section_of = np.empty(len(mesh.X), dtype=int)
    section_of[sections.nodes] = np.arange(len(sections.nodes))[:, None]
    lowest = section_of[mesh.cells].min(axis=1)
    numbers = [int(np.bincount(owner[lowest == section]).argmax()) for section in range(len(sections.spacing))]
    rubber = [material.law.name in RUBBER for material in materials]
    rod = rods.make_rod(sections, shape, _moduli(materials), np.array(numbers), rubber)
    return Body(mesh, element, (), sections, rod)


def _assigned(
    mesh: Mesh, element: Element, material: Material, regions: Sequence[tuple[np.ndarray, Material]]
) -> tuple[list[Material], np.ndarray]:
    """Materials, the main one first, and the number (m,) of the one that each cell has; later regions win."""
    owner = np.zeros(len(mesh.cells), dtype=int)
    for number, (cells, _) in enumerate(regions, 1):
        owner[cells] = number
    materials = [material, *(region_material for _, region_material in regions)]
    for known in materials:
        _check(known, element)
    return materials, owner


def _moduli(materials: Sequence[Material]) -> list[tuple[float, float]]:
    """Young's modulus MPa and Poisson's ratio of each material."""
    return [(material.young, material.poisson) for material in materials]


def with_materials(body: Body, materials: Sequence[Material]) -> Body:
    """The body of other materials: the main one, then one a region as `make_body` had them. Raises InputError."""
    for material in materials:
        _check(material, body.element)

    def remade(part: Solid) -> Solid:
        material = materials[part.number]
        parameters, bulk = material.moduli
        return replace(part, law=material.law, parameters=parameters, bulk=bulk)

    rod = None if body.rod is None else rods.with_moduli(body.rod, _moduli(materials))
    changed = replace(body, solids=tuple(map(remade, body.solids)), rod=rod)
    contact = body.contact and replace(body.contact, touching=walls.touching_pressure(changed.shear))
    return replace(changed, contact=contact)


def on_nodes(body: Body, mesh: Mesh) -> Body:
    """The body of solids on another mesh of the same connectivity. InputError where a cell is inverted or flat."""

    def remade(part: Solid) -> Solid:
        gradients, weights = reference_gradients(body.element, mesh.X, part.cells)
        if not (weights > 0).all():
            raise InputError("the moved mesh has cells that are inverted or flat", do="move it less")
        return replace(part, X=mesh.X, gradients=gradients, weights=weights)

    layers = tuple(membrane.moved(layer, mesh.X, body.cells) for layer in body.layers)
    contact = body.contact and walls.at_rest(body.contact, mesh.X)
    return replace(body, mesh=mesh, solids=tuple(map(remade, body.solids)), layers=layers, contact=contact)


def _check(material: Material, element: Element) -> None:
    """Raises InputError where moduli are not finite and positive, or the element does not converge with them."""
    parameters, bulk = material.moduli
    if not (np.isfinite(parameters).all() and np.isfinite(bulk) and material.young > 0):
        raise InputError(f"{material.law.name}: moduli must be finite and positive, young is {material.young:g} MPa")
    if element.bubbles and material.poisson > _STIFFEST_WITH_BUBBLES:
        limit = f"element {element.name} does not converge beyond nu {_STIFFEST_WITH_BUBBLES:g}"
        raise InputError(f"{limit}, and the material's is {material.poisson:g}", do="use tet10p0")


def without(body: Body, cells_within: np.ndarray) -> Body:
    """The body without the cells all of whose nodes carry the same number >= 0 in cells_within (n,): the inside of a
    rigid group deforms nothing."""

    def deforms(cells: np.ndarray) -> np.ndarray:
        numbers = cells_within[cells]
        return (numbers < 0).any(axis=1) | (numbers != numbers[:, :1]).any(axis=1)

    return replace(of_cells(body, deforms(body.cells)), sections=body.sections, rod=body.rod, contact=body.contact)


def of_cells(body: Body, keep: np.ndarray) -> Body:
    """The solids and layers of some of the body's cells alone, keep (m,) bool."""

    def kept(part: Solid, mine: np.ndarray) -> Solid:
        return replace(part, cells=part.cells[mine], gradients=part.gradients[mine], weights=part.weights[mine])

    solids = [kept(part, keep[place]) for part, place in body.parts()]
    left = Body(body.mesh, body.element, tuple(part for part in solids if len(part.cells)))
    return replace(left, layers=tuple(membrane.kept(layer, keep, left.cells) for layer in body.layers))


def response(body: Body, x: np.ndarray, pressure: np.ndarray | None = None) -> BodyResponse:
    """Response at positions x (n, 3) mm and element pressures (m,) MPa, by default (or empty) what x itself demands."""
    force = np.zeros_like(x)
    given = np.empty(0) if pressure is None else pressure
    solids = tuple(
        region.response(part, x, given[place] if len(given) else given, force) for part, place in body.parts()
    )
    rod = None if body.rod is None else rods.response(body.rod, x)
    layers = tuple(membrane.response(layer, x, force) for layer in body.layers)
    contact, none = body.contact and walls.response(body.contact, x, force), np.empty(0)
    return BodyResponse(
        energy=sum(part.energy for part in (*solids, *layers, rod, contact) if part),
        force=force,
        mismatch=np.concatenate([none, *(solid.mismatch for solid in solids)]),
        pressure=np.concatenate([none, *(solid.pressure for solid in solids)]),
        min_J=float(np.min([solid.min_J for solid in solids] + ([rod.shortest] if rod else []))),
        solids=solids,
        rod=rod,
        layers=layers,
        contact=contact,
    )


def tangent(
    body: Body, state: BodyResponse, slots: Sequence[np.ndarray], data: np.ndarray, before: BodyResponse | None = None
) -> np.ndarray:
    """Adds the tangent stiffness (N/mm) to the lower triangle `data`, slots (m, k, k, 3) of each of the body's cliques
    as in assembly.py. Returns dtheta (m, n_nodes, 3) mm^2, the gradients of theta_mean V; empty without pressures.

    before: where the linear step to `state` began; the geometric part then uses the stress predicted there."""
    lags = [None] * len(body.solids)
    if before is not None:
        lags = [
            region.stress_lag(*responses) for responses in zip(body.solids, before.solids, state.solids, strict=True)
        ]
    dtheta = [
        region.tangent(part, part_response, slots[0][place], data, lag)
        for (part, place), part_response, lag in zip(body.parts(), state.solids, lags, strict=True)
    ]
    for number, layer in enumerate(body.layers):
        membrane.tangent(layer, state.layers[number], slots[0], data, before and before.layers[number])
    if body.contact is not None:
        walls.tangent(body.contact, state.contact, slots[1], data)
    return np.concatenate([np.zeros((0, body.element.n_nodes, 3)), *dtheta])


def tangent_form(body: Body, state: BodyResponse, motions: np.ndarray) -> np.ndarray:
    """Form M^T A M (k, k) N mm of the tangent stiffness A of solids, layers and contact, and motions M (n, 3, k) mm."""
    form = np.zeros((motions.shape[2], motions.shape[2]))
    for part, part_response in zip(body.solids, state.solids, strict=True):
        form += region.tangent_form(part, part_response, motions)
    for layer, layer_response in zip(body.layers, state.layers, strict=True):
        form += membrane.tangent_form(layer, layer_response, motions)
    if body.contact is not None:
        form += walls.tangent_form(body.contact, state.contact, motions)
    return form


def pressure_force(body: Body, dtheta: np.ndarray, pressure: np.ndarray) -> np.ndarray:
    """Nodal force (n, 3) N of element pressures (m,) MPa."""
    force = np.zeros_like(body.mesh.X)
    for part, place in body.parts():
        region.pressure_force(part, dtheta[place], pressure[place], force)
    return force


def bulk_over_volume(body: Body) -> np.ndarray:
    """Bulk modulus over volume (m,) MPa/mm^3 of the cells."""
    return np.concatenate([part.bulk / part.volumes for part in body.solids])
