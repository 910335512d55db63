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
from cfem.equilibrium.robot import Robot
from cfem.mechanics.body import on_nodes
from cfem.mechanics.load import gravity
from cfem.mechanics.mesh import Mesh
from cfem.robot.selection import select_cells
from cfem.robot.shape.deform import displacement
from cfem.robot.spec import SceneSpec


def on_mesh(scene: SceneSpec, robot: Robot, mesh: Mesh) -> Robot:
    """The robot of `scene`, built on mesh.base, on the mesh itself."""
    body = on_nodes(robot.body, mesh)
    form = scene.shape

    def follow(place: np.ndarray) -> np.ndarray:
        return place if form is None else place + displacement(form.controls, place[None])[0]

    loads = robot.loads
    if scene.gravity is not None:
        density = _densities(scene, mesh.base)
        weight = [gravity(one, density, scene.gravity.acceleration) for one in (robot.body, body)]
        loads = loads + weight[1] - weight[0]
    return replace(
        robot,
        body=body,
        actuators=tuple(_actuator(one, mesh) for one in robot.actuators),
        effectors=tuple(watched(one, mesh, follow) for one in robot.effectors),
        contacts=tuple(replace(one, attachment=moved(one.attachment, mesh)) for one in robot.contacts),
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


def watched(one, mesh: Mesh, follow):
    """An effector on the mesh. follow: where a place (3,) mm outside the body goes."""
    if isinstance(one, PointEffector):
        return replace(one, attachment=moved(one.attachment, mesh))
    if isinstance(one, CarriedEffector):
        carrier, place = carried(one.carrier, mesh), follow(one.rest)
        return CarriedEffector(carrier, place - carrier.centre, place)
    if isinstance(one, RotationEffector):
        return RotationEffector(carried(one.carrier, mesh))
    if isinstance(one, CombinedEffector):
        return replace(one, parts=tuple(watched(part, mesh, follow) for part in one.parts))
    raise SpecError(f"an effector of kind {type(one).__name__} cannot follow a free form")


def _actuator(one, mesh: Mesh):
    if isinstance(one, Cable):
        return one.at_rest(mesh.X)
    if isinstance(one, Push):
        return replace(one, rest=one.value(mesh.X))
    if isinstance(one, Cavity):
        return replace(one, rest_volume=one.rest_volume + float(one.value(mesh.X)[0]))
    raise SpecError(f"an actuator of kind {type(one).__name__} cannot follow a free form")


def _densities(scene: SceneSpec, mesh: Mesh) -> np.ndarray:
    """(m,) t/mm^3 of the cells of the mesh that the regions are selected on."""
    density = np.full(len(mesh.cells), scene.material.density)
    for index, item in enumerate(scene.materials):
        density[select_cells(mesh, item.region, f"materials.{index}.region")] = item.material.density
    return density
