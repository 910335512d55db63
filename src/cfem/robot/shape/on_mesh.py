"""A robot on another mesh of the same connectivity: what is attached keeps its nodes and weights."""

from dataclasses import replace

import numpy as np

from cfem.constraint.attachment import Attachment
from cfem.constraint.cable import Cable
from cfem.constraint.carrier import Carrier
from cfem.constraint.cavity import Cavity
from cfem.constraint.effector import CarriedEffector, CombinedEffector, PointEffector, RotationEffector
from cfem.constraint.push import Push
from cfem.core.errors import SpecError
from cfem.equilibrium.system.robot import Robot
from cfem.mechanics.body import on_nodes
from cfem.mechanics.mass import gravity
from cfem.mechanics.mesh import Mesh
from cfem.robot.selection import select_cells
from cfem.robot.shape.deform import displacement
from cfem.robot.spec import SceneSpec


def on_mesh(scene: SceneSpec, robot: Robot, mesh: Mesh) -> Robot:
    """Robot of a scene on a mesh with its free form; robot: the same, built on `mesh.base`."""
    body = on_nodes(robot.body, mesh)
    form = scene.shape

    def follow(place: np.ndarray) -> np.ndarray:
        return place if form is None else place + displacement(form.controls, place[None])[0]

    loads = robot.loads
    if scene.gravity is not None:
        density = _densities(scene, mesh.base)
        weight = [gravity(shaped, density, scene.gravity.acceleration) for shaped in (robot.body, body)]
        loads = loads + weight[1] - weight[0]
    return replace(
        robot,
        body=body,
        actuators=tuple(_actuator(actuator, mesh) for actuator in robot.actuators),
        effectors=tuple(watched(effector, mesh, follow) for effector in robot.effectors),
        contacts=tuple(replace(point, attachment=moved(point.attachment, mesh)) for point in robot.contacts),
        loads=loads,
    )


def moved(attachment: Attachment, mesh: Mesh) -> Attachment:
    """The attachment on another mesh of the same connectivity."""
    return replace(attachment, point=attachment.position(mesh.X))


def carried(carrier: Carrier, mesh: Mesh) -> Carrier:
    """The carrier on another mesh of the same connectivity."""
    X = mesh.X[carrier.nodes]
    centre = carrier.weights @ X
    return replace(carrier, centre=centre, arm=X - centre)


def watched(effector, mesh: Mesh, follow):
    """An effector on the mesh. follow: where a place (3,) mm outside the body goes."""
    if isinstance(effector, PointEffector):
        return replace(effector, attachment=moved(effector.attachment, mesh))
    if isinstance(effector, CarriedEffector):
        carrier, place = carried(effector.carrier, mesh), follow(effector.rest)
        return CarriedEffector(carrier, place - carrier.centre, place)
    if isinstance(effector, RotationEffector):
        return RotationEffector(carried(effector.carrier, mesh))
    if isinstance(effector, CombinedEffector):
        return replace(effector, parts=tuple(watched(part, mesh, follow) for part in effector.parts))
    raise SpecError(f"an effector of kind {type(effector).__name__} cannot follow a free form")


def _actuator(actuator, mesh: Mesh):
    """The actuator at rest on the mesh."""
    if isinstance(actuator, Cable):
        return actuator.at_rest(mesh.X)
    if isinstance(actuator, Push):
        return replace(actuator, rest=actuator.value(mesh.X))
    if isinstance(actuator, Cavity):
        return replace(actuator, rest_volume=actuator.rest_volume + float(actuator.value(mesh.X)[0]))
    raise SpecError(f"an actuator of kind {type(actuator).__name__} cannot follow a free form")


def _densities(scene: SceneSpec, mesh: Mesh) -> np.ndarray:
    """Densities (m,) t/mm^3 of the cells, with regions selected on this mesh."""
    density = np.full(len(mesh.cells), scene.material.density)
    for index, item in enumerate(scene.materials):
        density[select_cells(mesh, item.region, f"materials.{index}.region")] = item.material.density
    return density
