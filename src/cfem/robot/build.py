"""The robot that mechanics solves, from a scene and its mesh."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from cfem.condensed import Rows
from cfem.condensed.viscosity import Viscosity
from cfem.constraint.attachment import Attachment, attach
from cfem.constraint.cable import Cable, make_cable
from cfem.constraint.cavity import Cavity, enclosed, is_skin, make_cavity
from cfem.constraint.centre_of_mass import centre_of_mass
from cfem.constraint.contact import ContactPoint
from cfem.constraint.effector import make_effector
from cfem.constraint.protocol import Watched
from cfem.constraint.push import Push, make_push
from cfem.constraint.rod_cable import RodCable, make_rod_cable
from cfem.constraint.rod_chambers import RodChambers, make_rod_chambers
from cfem.constraint.section_point import attach_to_sections, make_section_effector
from cfem.core.errors import SpecError
from cfem.equilibrium.system.robot import Robot
from cfem.mechanics.body import Body, make_body, make_rod_body
from cfem.mechanics.element import ELEMENTS, SECTIONED
from cfem.mechanics.mass import gravity
from cfem.mechanics.material import LAWS
from cfem.mechanics.material.law import Material
from cfem.mechanics.mesh import Mesh
from cfem.mechanics.rod.region import Rod
from cfem.mechanics.rod.sections import Sections
from cfem.robot import constraints, spec
from cfem.robot.catalogue import stiff_flop
from cfem.robot.catalogue.cross_sections import cross_section
from cfem.robot.catalogue.sections import sections_of
from cfem.robot.checks.possible import demand_possible
from cfem.robot.discrepancy import discrepancy_in
from cfem.robot.layers import layered
from cfem.robot.materials import MaterialSpec
from cfem.robot.places import cable_points, effector_points, pull_point
from cfem.robot.selection import cells_of, facets_of, rigid_groups, select_cells, select_nodes
from cfem.robot.self_contact import touching_itself
from cfem.robot.shape.deform import shaped
from cfem.robot.shape.on_mesh import on_mesh


def build_robot(scene: spec.SceneSpec, mesh: Mesh) -> Robot:
    """Robot of a scene on its mesh. SpecError, with the key that is wrong and its file and line, where a point lies
    outside the body, a chamber is not closed, a selection is empty or an actuator's reach cannot be."""
    with scene.locating():
        if scene.shape is None:
            return _robot(scene, mesh)
        if mesh.unshaped is None:
            mesh = shaped(scene.shape, mesh)
        return on_mesh(scene, _robot(scene, mesh.base), mesh)


def with_actuator(scene: spec.SceneSpec, mesh: Mesh, robot: Robot, index: int) -> Robot:
    """The robot, of this mesh, with one actuator rebuilt from the scene. Body and loads are the same objects."""
    sections = sections_of(mesh) if scene.mesh.element in SECTIONED else []
    with scene.locating("actuators", index):
        rebuilt = _actuator(scene, mesh, robot.body, scene.actuators[index], sections)
    return replace(robot, actuators=(*robot.actuators[:index], rebuilt, *robot.actuators[index + 1 :]))


def _robot(scene: spec.SceneSpec, mesh: Mesh) -> Robot:
    """Robot on a mesh before its free form. SpecError, with file and line, where a part of the scene cannot be made."""
    regions = [
        select_cells(mesh, item.region, f"materials.{index}.region") for index, item in enumerate(scene.materials)
    ]
    sections = sections_of(mesh) if scene.mesh.element in SECTIONED else []
    body = _body(scene, mesh, regions, sections)
    fixed = [select_nodes(mesh, part, f"fixed.{index}") for index, part in enumerate(scene.fixed)]
    fixed = np.unique(np.concatenate(fixed))
    robot = Robot(
        name=scene.name,
        body=body,
        fixed=fixed,
        actuators=_each(scene, "actuators", lambda item: _actuator(scene, mesh, body, item, sections)),
        effectors=_each(scene, "effectors", lambda item: _effector(scene, mesh, item, sections, body, regions)),
        rows=Rows(
            effectors=tuple(f"{item.name}.{axis}" for item in scene.effectors for axis in item.axes),
            actuators=tuple(item.name for item in scene.actuators),
            contacts=tuple(f"{item.name}.{axis}" for item in scene.contacts for axis in "xyz"),
        ),
        reach=np.array([item.reach for item in scene.actuators]).reshape(-1, 2),
        unilateral=np.array([item.unilateral for item in scene.actuators], dtype=bool),
        length=scene.length,
        contacts=_each(scene, "contacts", lambda item: _contact(mesh, item, sections)),
        rigid=_rigid(scene, mesh, sections, fixed),
        loads=_loads(scene, body, regions, sections),
        forces=_forces(scene),
        density=_density(scene, mesh, regions),
        viscosity=_viscosity(scene),
    )
    robot = replace(robot, discrepancy=discrepancy_in(scene.discrepancy, robot.rows, robot.actuator_units))
    demand_possible(scene, robot)
    return robot


def _each(scene: spec.SceneSpec, key: str, make: Callable[[Any], Any]) -> tuple:
    """Results of `make(item)` for every item under `key`. A SpecError states file and line of the item."""
    results = []
    for index, item in enumerate(getattr(scene, key)):
        with scene.locating(key, index):
            results.append(make(item))
    return tuple(results)


def materials_of(scene: spec.SceneSpec) -> list[Material]:
    """Materials of the scene: the body's, then one of each region."""
    return [as_material(material) for material in scene.all_materials.values()]


def as_material(material: MaterialSpec) -> Material:
    """The material as mechanics knows it."""
    return Material(LAWS[material.law], material.young, material.poisson, material.shape)


def _body(scene: spec.SceneSpec, mesh: Mesh, regions: list[np.ndarray], sections: list[np.ndarray]) -> Body:
    """Body of solid elements, of rigid sections joined by elements, or of a rod, as `mesh.element` says."""
    element, (main, *others) = scene.mesh.element, materials_of(scene)
    parts = list(zip(regions, others, strict=True))
    if element not in SECTIONED:
        solid = layered(scene.layers, mesh, make_body(mesh, ELEMENTS[element], main, parts))
        return touching_itself(scene.self_contact, solid, scene.length)
    rigid_sections = Sections(mesh.X, np.stack(sections))
    if element == "beam":
        shape = cross_section(scene.geometry, rigid_sections.centres[:, 0], scene.material.poisson)
        return make_rod_body(mesh, SECTIONED[element], rigid_sections, shape, main, parts)
    return replace(make_body(mesh, SECTIONED[element], main, parts), sections=rigid_sections)


def _rigid(scene: spec.SceneSpec, mesh: Mesh, sections: list[np.ndarray], fixed: np.ndarray) -> tuple[np.ndarray, ...]:
    if sections:
        return _free_sections(sections, fixed)
    if isinstance(scene.geometry, spec.StiffFlop):
        return stiff_flop.windings(scene.geometry, mesh)
    return rigid_groups(mesh, scene.rigid, fixed)


def _free_sections(sections: list[np.ndarray], fixed: np.ndarray) -> tuple[np.ndarray, ...]:
    """Nodes of the sections that are not held. SpecError where one is held in part."""
    free = []
    for number, nodes in enumerate(sections):
        held = np.isin(nodes, fixed)
        if held.any() and not held.all():
            what = f"holds {held.sum()} of the {len(held)} nodes of section {number}, which is rigid"
            raise SpecError(what, where="fixed", do="hold the whole section or none of it")
        if not held.any():
            free.append(nodes)
    return tuple(free)


def _forces(scene: spec.SceneSpec) -> np.ndarray | None:
    """Smallest and largest pressures (n_a, 2) MPa, None unless all actuators state theirs."""
    ranges = [getattr(item, "pressure", None) for item in scene.actuators]
    return None if not ranges or any(pair is None for pair in ranges) else np.array(ranges)


def _attach(
    mesh: Mesh, point: np.ndarray, radius: float, label: str, cells: np.ndarray | None, sections: list[np.ndarray]
) -> Attachment:
    if sections:
        return attach_to_sections(mesh.X, sections, point, label)
    return attach(mesh, point, radius, label, cells)


def _actuator(
    scene: spec.SceneSpec, mesh: Mesh, body: Body, item: constraints.Actuator, sections: list[np.ndarray]
) -> Cable | RodCable | Push | Cavity | RodChambers:
    """Constraint of one actuator, attached to the mesh, or to the sections of a rod."""
    if isinstance(item, constraints.Cavity):
        return _cavity(mesh, item)
    if isinstance(item, constraints.Chambers):
        return _chambers(scene.geometry, mesh, body, item)
    if isinstance(item, constraints.Push):
        return make_push(_points(mesh, item, item.points, sections, f"push '{item.name}'"), item.direction)
    if body.rod is not None and _in_rod(body.rod, item):
        return make_rod_cable(body.rod, cable_points(scene, item), item.name, item.friction)
    points = _points(mesh, item, cable_points(scene, item), sections, f"cable '{item.name}'")
    return make_cable(points, pull_point(scene, item), item.name, item.friction)


def _points(
    mesh: Mesh, item: constraints.Cable | constraints.Push, places: np.ndarray, sections: list[np.ndarray], label: str
) -> list[Attachment]:
    """Attachments of the points at `places` (k, 3) mm. SpecError names the point that is not on the body."""
    cells, points = _cells(mesh, item.body), []
    for index, place in enumerate(places):
        try:
            points.append(_attach(mesh, place, item.radius, f"point {index} of {label}", cells, sections))
        except SpecError as error:
            routed = getattr(item, "route", None) is not None
            raise SpecError(error.what, where="route" if routed else f"points.{index}", do=error.do) from None
    return points


def _in_rod(rod: Rod, item: constraints.Cable) -> bool:
    """True if the cable runs in the rod from its held base on, so that its pull point moves nothing."""
    return item.pull_point is None or abs(item.points[0, 0] - rod.sections.centres[0, 0]) < 1e-9


def _chambers(geometry: spec.StiffFlop, mesh: Mesh, body: Body, item: constraints.Chambers) -> Cavity | RodChambers:
    if body.rod is None:
        surface = stiff_flop.chamber_surface(geometry, mesh, item.module, item.chambers)
        return make_cavity(mesh.X, surface, item.name)
    centres = stiff_flop.chamber_centres(geometry, item.chambers)
    elements = stiff_flop.module_elements(geometry, mesh, item.module)
    return make_rod_chambers(body.rod, centres, stiff_flop.chamber_area(geometry), elements)


def _cavity(mesh: Mesh, item: constraints.Cavity) -> Cavity:
    """Cavity behind the facets of a set, or around a point inside. SpecError where these are the outer skin."""
    label = f"cavity '{item.name}'"
    if item.surface is not None:
        facets = facets_of(mesh, item.surface, "surface")
    else:
        facets = mesh.facets[enclosed(mesh, item.inside, label)]
    cavity = make_cavity(mesh.X, facets, item.name)
    if is_skin(mesh.X, facets):
        raise SpecError(
            f"{label}: '{item.surface}' is the outer skin of the body, not the wall of a chamber",
            do="name the facets of the chamber's wall, or give a point inside the chamber with `inside`",
        )
    return cavity


def _effector(
    scene: spec.SceneSpec,
    mesh: Mesh,
    item: constraints.Effector,
    sections: list[np.ndarray],
    body: Body,
    regions: list[np.ndarray],
) -> Watched:
    """Effector on the centre of mass, on rigid sections or plates, or on points of the body."""
    if item.at == "centre-of-mass":
        return centre_of_mass(body, _density(scene, mesh, regions), item.name)
    points = effector_points(scene, item)
    if sections:
        return make_section_effector(mesh.X, sections, points, item.name, item.orientation)
    if isinstance(scene.geometry, spec.StiffFlop):
        plates = stiff_flop.plates_of(scene.geometry, mesh)
        if np.isin(np.atleast_2d(points)[:, 0], [mesh.X[nodes[0], 0] for nodes in plates]).all():
            return make_section_effector(mesh.X, plates, points, item.name, item.orientation)
    cells = _cells(mesh, item.body)
    return make_effector(mesh, points, item.radius, item.carrier_radius, item.name, item.orientation, cells)


def _contact(mesh: Mesh, item: constraints.Contact, sections: list[np.ndarray]) -> ContactPoint:
    label = f"contact point '{item.name}'"
    return ContactPoint(_attach(mesh, item.point, item.radius, label, _cells(mesh, item.body), sections))


def _loads(
    scene: spec.SceneSpec, body: Body, regions: list[np.ndarray], sections: list[np.ndarray]
) -> np.ndarray | None:
    """Forces (n, 3) N of weight and loads on the nodes, None where the scene has neither."""
    if scene.gravity is None and not scene.loads:
        return None
    forces, mesh = np.zeros_like(body.mesh.X), body.mesh
    if scene.gravity is not None:
        forces += gravity(body, _density(scene, mesh, regions), scene.gravity.acceleration)
    points = _each(
        scene, "loads", lambda load: _attach(mesh, load.point, load.radius, "load", _cells(mesh, load.body), sections)
    )
    for point, load in zip(points, scene.loads, strict=True):
        forces[point.nodes] += point.weights[:, None] * load.force
    return forces


def _density(scene: spec.SceneSpec, mesh: Mesh, regions: list[np.ndarray]) -> np.ndarray | None:
    """Densities (m,) t/mm^3 of the cells, None where a material does not state its own."""
    if any(material.density is None for material in scene.all_materials.values()):
        return None
    density = np.full(len(mesh.cells), scene.material.density)
    for cells, item in zip(regions, scene.materials, strict=True):
        density[cells] = item.material.density
    return density


def _viscosity(scene: spec.SceneSpec) -> tuple[Viscosity, ...]:
    """Viscosity of each material, the body's first; empty where none is viscous."""
    specs = [material.viscosity for material in scene.all_materials.values()]
    viscosities = tuple(
        Viscosity()
        if spec is None
        else Viscosity(spec.relaxation, tuple((term.share, term.time) for term in spec.prony))
        for spec in specs
    )
    return () if all(viscosity.none for viscosity in viscosities) else viscosities


def _cells(mesh: Mesh, body: str | None) -> np.ndarray | None:
    """The cells that a point may be attached to, None for all."""
    return None if body is None else cells_of(mesh, body, "body")
