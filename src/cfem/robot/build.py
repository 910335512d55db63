"""From a scene and its mesh to the robot that mechanics solves."""

import numpy as np

from cfem.condensed import Rows
from cfem.constraint.attachment import attach
from cfem.constraint.cable import Cable, make_cable
from cfem.constraint.cavity import Cavity, enclosed, make_cavity
from cfem.constraint.contact import ContactPoint
from cfem.constraint.effector import make_effector
from cfem.constraint.protocol import Watched
from cfem.equilibrium.robot import Robot
from cfem.mechanics.body import Body, make_body
from cfem.mechanics.element import ELEMENTS
from cfem.mechanics.load import gravity
from cfem.mechanics.material import LAWS
from cfem.mechanics.material.law import Material
from cfem.mechanics.mesh import Mesh
from cfem.robot import constraints, spec
from cfem.robot.materials import MaterialSpec
from cfem.robot.rigid import rigid_groups
from cfem.robot.selection import cells_of, facets_of, select_cells, select_nodes


def build_robot(scene: spec.SceneSpec, mesh: Mesh) -> Robot:
    """Raises SpecError where a point lies outside the body, a chamber is not closed or a selection is empty."""
    regions = [
        select_cells(mesh, item.region, f"materials[{index}].region") for index, item in enumerate(scene.materials)
    ]
    body = _body(scene, mesh, regions)
    fixed = [select_nodes(mesh, part, f"fixed[{index}]") for index, part in enumerate(scene.fixed)]
    fixed = np.unique(np.concatenate(fixed))
    return Robot(
        name=scene.name,
        body=body,
        fixed=fixed,
        actuators=tuple(_actuator(mesh, item) for item in scene.actuators),
        effectors=tuple(_effector(mesh, item) for item in scene.effectors),
        rows=Rows(
            effectors=tuple(f"{item.name}.{axis}" for item in scene.effectors for axis in item.axes),
            actuators=tuple(item.name for item in scene.actuators),
            contacts=tuple(f"{item.name}.{axis}" for item in scene.contacts for axis in "xyz"),
        ),
        reach=np.array([item.reach for item in scene.actuators]),
        unilateral=np.array([item.unilateral for item in scene.actuators]),
        length=scene.length,
        contacts=tuple(_contact(mesh, item) for item in scene.contacts),
        rigid=rigid_groups(mesh, scene.rigid, fixed),
        loads=_loads(scene, body, regions),
    )


def as_material(material: MaterialSpec) -> Material:
    """The material as mechanics knows it."""
    return Material(LAWS[material.law], material.young, material.poisson, material.shape)


def _body(scene: spec.SceneSpec, mesh: Mesh, regions: list[np.ndarray]) -> Body:
    others = [as_material(item.material) for item in scene.materials]
    element, main = ELEMENTS[scene.mesh.element], as_material(scene.material)
    return make_body(mesh, element, main, list(zip(regions, others, strict=True)))


def _actuator(mesh: Mesh, item: constraints.Cable | constraints.Cavity) -> Cable | Cavity:
    if isinstance(item, constraints.Cavity):
        return _cavity(mesh, item)
    label = f"cable '{item.name}'"
    cells = _cells(mesh, item.body, label)
    points = [
        attach(mesh, point, item.radius, f"{label} point {index + 1}", cells) for index, point in enumerate(item.points)
    ]
    return make_cable(points, item.pull_point, item.name)


def _cavity(mesh: Mesh, item: constraints.Cavity) -> Cavity:
    label = f"cavity '{item.name}'"
    if item.surface is not None:
        facets = facets_of(mesh, item.surface, f"{label} surface")
    else:
        facets = mesh.facets[enclosed(mesh, item.inside, label)]
    return make_cavity(mesh.X, facets, item.name)


def _effector(mesh: Mesh, item: constraints.Effector) -> Watched:
    points = item.point if item.points is None else item.points
    cells = _cells(mesh, item.body, f"effector '{item.name}'")
    return make_effector(mesh, points, item.radius, item.carrier_radius, item.name, item.orientation, cells)


def _contact(mesh: Mesh, item: constraints.Contact) -> ContactPoint:
    label = f"contact point '{item.name}'"
    return ContactPoint(attach(mesh, item.point, item.radius, label, _cells(mesh, item.body, label)))


def _loads(scene: spec.SceneSpec, body: Body, regions: list[np.ndarray]) -> np.ndarray | None:
    """(n, 3) N, None where the scene has neither weight nor loads."""
    if scene.gravity is None and not scene.loads:
        return None
    forces, mesh = np.zeros_like(body.mesh.X), body.mesh
    if scene.gravity is not None:
        density = np.full(len(mesh.cells), scene.material.density)
        for cells, item in zip(regions, scene.materials, strict=True):
            density[cells] = item.material.density
        forces += gravity(body, density, scene.gravity.acceleration)
    for index, load in enumerate(scene.loads):
        label = f"loads[{index}]"
        at = attach(mesh, load.point, load.radius, label, _cells(mesh, load.body, label))
        forces[at.nodes] += at.weights[:, None] * load.force
    return forces


def _cells(mesh: Mesh, body: str | None, label: str) -> np.ndarray | None:
    """The cells that a point may be attached to, None for all."""
    return None if body is None else cells_of(mesh, body, f"{label} body")
