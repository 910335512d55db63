"""The robots of one scene with other shapes: the reference mesh morphed, its attachments kept on the same nodes."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from pydantic.fields import FieldInfo

from cfem.constraint.attachment import attach, show
from cfem.constraint.cable import make_cable
from cfem.constraint.effector import CarriedEffector, PointEffector
from cfem.core.errors import SpecError
from cfem.core.units import unit_of, written
from cfem.equilibrium.system.robot import Robot
from cfem.mechanics.body import with_materials
from cfem.mechanics.mesh import Mesh
from cfem.robot import constraints
from cfem.robot.build import build_robot, materials_of
from cfem.robot.catalogue.solids import CATALOGUE
from cfem.robot.places import cable_points, effector_points, pull_point
from cfem.robot.shape.deform import Deformation
from cfem.robot.shape.morph import Morph, Unreachable
from cfem.robot.shape.on_mesh import carried, moved, on_mesh
from cfem.robot.spec import SceneSpec


class Designs:
    """Robots of varied geometries on one morphed mesh. Regions and rigid groups keep their cells and nodes."""

    def __init__(self, scene: SceneSpec, mesh: Mesh):
        """Prepares the morph from the reference scene and its mesh. SpecError where the scene has what does not move
        with a design yet: contacts, loads on points, effectors of several points."""
        kind = scene.geometry.kind
        if type(scene.geometry) not in CATALOGUE or mesh.cells.shape[1] == 8:
            raise SpecError(
                f"a geometry of kind {kind} cannot be varied", do="use a catalogue geometry meshed with tetrahedra"
            )
        foreign = [name for name in ("contacts", "loads") if getattr(scene, name)]
        if foreign:
            raise SpecError(f"{', '.join(foreign)} cannot follow a varied geometry yet", do="leave it out")
        self.reference = build_robot(scene, mesh)
        mesh = mesh.base
        cables = [attach(mesh, point, radius, name) for name, radius, point in _places(scene)]
        inside = [effector.attachment for effector in self.reference.effectors if isinstance(effector, PointEffector)]
        if not all(isinstance(effector, PointEffector | CarriedEffector) for effector in self.reference.effectors):
            raise SpecError("effectors of several points, or with an orientation, cannot follow a varied geometry yet")
        self._points = cables + inside
        watched = zip(scene.effectors, self.reference.effectors, strict=True)
        self._names = [f"cable '{name}'" for name, _, _ in _places(scene)]
        self._names += [f"effector '{item.name}'" for item, effector in watched if isinstance(effector, PointEffector)]
        self._geometry, self._last = scene.geometry, (None, mesh)
        self._form = None if scene.shape is None else Deformation(scene.shape, mesh)
        self._morph = Morph(mesh, CATALOGUE[type(scene.geometry)](scene.geometry), self._points)

    def mesh(self, scene: SceneSpec) -> Mesh:
        """Mesh of the scene with another geometry. Unreachable where it is too far from the reference."""
        return self._shaped(scene, self.base(scene))

    def base(self, scene: SceneSpec) -> Mesh:
        """The mesh before its free form. Unreachable as `mesh`."""
        places = self._prescribed(scene)
        key = (repr(scene.geometry), places.tobytes())
        try:
            if self._last[0] != key:  # robots whose free form alone differs have it in common
                self._last = key, self._morph(CATALOGUE[type(scene.geometry)](scene.geometry), places)
            return self._last[1]
        except Unreachable as error:
            where = f"design {self._design(scene)}"
            if error.near is not None:
                where += f", near {self._names[error.near]} at {show(places[error.near])} mm"
            do = "keep the point inside the body of every design, or stay nearer to the scene's own"
            raise Unreachable(error.what, error.near, where=where, do=do) from None

    def changes(self, scene: SceneSpec, sums: Sequence[Sequence[tuple[float, SceneSpec]]]) -> np.ndarray:
        """Weighted sums (k, n, 3) of nodes, before the free form, of scenes that hardly differ from `scene`, to first
        order; the weights of each sum add up to 0. Unreachable as `mesh`."""
        solid = CATALOGUE[type(scene.geometry)]
        sums_of_solids = [
            [(weight, solid(design.geometry), self._prescribed(design)) for weight, design in terms] for terms in sums
        ]
        return self._morph.changes(solid(scene.geometry), self.base(scene).X, sums_of_solids)

    def beside(self, scene: SceneSpec, base: Mesh, change: np.ndarray | float) -> Robot:
        """Robot of a scene that hardly differs from that of the mesh `base`, whose nodes `change` (n, 3) mm moves."""
        return self._on(scene, self._shaped(scene, replace(base, X=base.X + change)))

    def _shaped(self, scene: SceneSpec, base: Mesh) -> Mesh:
        return base if scene.shape is None else self._form(scene.shape, base)

    def _prescribed(self, scene: SceneSpec) -> np.ndarray:
        """Places (k, 3) mm to which a design moves the attached points."""
        cables = [point for _, _, point in _places(scene)]
        pairs = zip(scene.effectors, self.reference.effectors, strict=True)
        inside = [effector_points(scene, item) for item, effector in pairs if isinstance(effector, PointEffector)]
        return np.array(cables + inside)

    def _design(self, scene: SceneSpec) -> str:
        """Words for the parameters of the geometry that differ from the reference."""
        fields = type(scene.geometry).model_fields
        values = ((name, getattr(self._geometry, name), getattr(scene.geometry, name)) for name in fields)
        changes = [
            f"{name} {_with_unit(fields[name], now)} for {_with_unit(fields[name], was)}"
            for name, was, now in values
            if was != now
        ]
        return ", ".join(changes) or "of the scene"

    def robot(self, scene: SceneSpec) -> Robot:
        """Robot of the scene with another geometry. Raises Unreachable as `mesh` does."""
        return self._on(scene, self.mesh(scene))

    def _on(self, scene: SceneSpec, mesh: Mesh) -> Robot:
        """The reference robot with its points, cables and effectors moved to a morphed mesh."""
        base = mesh.base
        points = [moved(attachment, base) for attachment in self._points]
        actuators, used = [], 0
        for item, actuator in zip(scene.actuators, self.reference.actuators, strict=True):
            if not isinstance(item, constraints.Cable):
                actuators.append(actuator)
                continue
            count = len(cable_points(scene, item))
            along = points[used : used + count]
            actuators.append(make_cable(along, pull_point(scene, item), item.name, item.friction))
            used += count
        inside, effectors = iter(points[used:]), []
        for item, effector in zip(scene.effectors, self.reference.effectors, strict=True):
            if isinstance(effector, PointEffector):
                effectors.append(PointEffector(next(inside)))
                continue
            place = np.asarray(effector_points(scene, item), float)
            carrier = carried(effector.carrier, base)
            effectors.append(CarriedEffector(carrier, place - carrier.centre, place))
        body = with_materials(self.reference.body, materials_of(scene))
        robot = replace(self.reference, body=body, actuators=tuple(actuators), effectors=tuple(effectors))
        return on_mesh(scene, robot, mesh)


def _places(scene: SceneSpec) -> Sequence[tuple[str, float, np.ndarray]]:
    """Name, radius and place (3,) mm of every point of a cable."""
    cables = [item for item in scene.actuators if isinstance(item, constraints.Cable)]
    return [(item.name, item.radius, point) for item in cables for point in cable_points(scene, item)]


def _with_unit(field: FieldInfo, value: float) -> str:
    unit = unit_of(field)
    return f"{value:.4g}" if unit == "1" else written(float(f"{value:.6g}"), unit)
