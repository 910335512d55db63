"""The robots of one scene with other shapes: the reference mesh morphed, its attachments kept on the same nodes."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cfem.constraint.attachment import attach, show
from cfem.constraint.cable import make_cable
from cfem.constraint.carrier import Carrier
from cfem.constraint.effector import CarriedEffector, PointEffector
from cfem.core.errors import NumericalError, SpecError
from cfem.equilibrium.robot import Robot
from cfem.mechanics.mesh import Mesh
from cfem.robot import constraints
from cfem.robot.build import body_of, build_robot, cable_points, effector_points
from cfem.robot.meshing import CATALOGUE
from cfem.robot.morph import Morph, Unreachable, moved
from cfem.robot.spec import SceneSpec


class Designs:
    """scene, mesh: the reference. SpecError where the scene has what does not move with a design yet: anything but
    cables and effectors in the body, of one material."""

    def __init__(self, scene: SceneSpec, mesh: Mesh):
        kind = scene.geometry.kind
        if type(scene.geometry) not in CATALOGUE or mesh.cells.shape[1] == 8:
            raise SpecError(
                f"a geometry of kind {kind} cannot be varied", do="use a catalogue geometry meshed with tetrahedra"
            )
        foreign = [name for name in ("materials", "rigid", "contacts", "loads", "gravity") if getattr(scene, name)]
        foreign += [item.name for item in scene.actuators if not isinstance(item, constraints.Cable)]
        if foreign:
            raise SpecError(f"{', '.join(foreign)} cannot follow a varied geometry yet", do="leave it out")
        self.reference = build_robot(scene, mesh)
        self._mesh = mesh
        cables = [attach(mesh, point, radius, name) for name, radius, point in _places(scene)]
        inside = [one.attachment for one in self.reference.effectors if isinstance(one, PointEffector)]
        if not all(isinstance(one, PointEffector | CarriedEffector) for one in self.reference.effectors):
            raise SpecError("effectors of several points, or with an orientation, cannot follow a varied geometry yet")
        self._points = cables + inside
        watched = zip(scene.effectors, self.reference.effectors, strict=True)
        self._names = [f"cable '{name}'" for name, _, _ in _places(scene)]
        self._names += [f"effector '{item.name}'" for item, one in watched if isinstance(one, PointEffector)]
        self._geometry = scene.geometry
        self._morph = Morph(mesh, CATALOGUE[type(scene.geometry)](scene.geometry), self._points)

    def mesh(self, scene: SceneSpec) -> Mesh:
        """Of the scene with another geometry. NumericalError where it is too far from the reference."""
        cables = [point for _, _, point in _places(scene)]
        both = zip(scene.effectors, self.reference.effectors, strict=True)
        inside = [effector_points(scene, item) for item, one in both if isinstance(one, PointEffector)]
        places = np.array(cables + inside)
        try:
            return self._morph(CATALOGUE[type(scene.geometry)](scene.geometry), places)
        except Unreachable as error:
            where = f"design {self._design(scene)}"
            if error.near is not None:
                where += f", near {self._names[error.near]} at {show(places[error.near])} mm"
            do = "keep the point inside the body of every design, or stay nearer to the scene's own"
            raise NumericalError(error.what, where=where, do=do) from None

    def _design(self, scene: SceneSpec) -> str:
        """What of the geometry differs from the reference."""
        fields = type(scene.geometry).model_fields
        both = ((name, getattr(self._geometry, name), getattr(scene.geometry, name)) for name in fields)
        return (
            ", ".join(f"{name} {now:.4g} for {was:.4g} mm" for name, was, now in both if was != now) or "of the scene"
        )

    def robot(self, scene: SceneSpec) -> Robot:
        """Of the scene with another geometry."""
        mesh = self.mesh(scene)
        points = [moved(one, mesh) for one in self._points]
        actuators, used = [], 0
        for item in scene.actuators:
            count = len(cable_points(scene, item))
            actuators.append(make_cable(points[used : used + count], item.pull_point, item.name))
            used += count
        inside, effectors = iter(points[used:]), []
        for item, one in zip(scene.effectors, self.reference.effectors, strict=True):
            if isinstance(one, PointEffector):
                effectors.append(PointEffector(next(inside)))
                continue
            place = np.asarray(effector_points(scene, item), float)
            carrier = carried(one.carrier, mesh)
            effectors.append(CarriedEffector(carrier, place - carrier.centre, place))
        body = body_of(scene, mesh)
        return replace(self.reference, body=body, actuators=tuple(actuators), effectors=tuple(effectors))


def carried(carrier: Carrier, mesh: Mesh) -> Carrier:
    """The carrier on another mesh of the same connectivity."""
    X = mesh.X[carrier.nodes]
    centre = carrier.weights @ X
    return replace(carrier, centre=centre, arm=X - centre)


def _places(scene: SceneSpec) -> Sequence[tuple[str, float, np.ndarray]]:
    """Name, radius and place (3,) mm of every point of a cable."""
    return [(item.name, item.radius, point) for item in scene.actuators for point in cable_points(scene, item)]
