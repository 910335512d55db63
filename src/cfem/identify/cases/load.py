"""Rig and cases that a spec describes."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cfem.condensed.parameters import Parameter
from cfem.core.errors import SpecError
from cfem.identify.cases.discrepancy import DiscrepancyPrior
from cfem.identify.cases.rig import Rig
from cfem.identify.cases.robots import CaseRobots
from cfem.identify.cases.spec import CasesSpec
from cfem.identify.cases.table import Cases, read_cases
from cfem.identify.cases.unknowns import CaseUnknown, case_unknowns
from cfem.mechanics.mesh import Mesh
from cfem.robot.load import load_scene_and_mesh
from cfem.robot.spec import SceneSpec
from cfem.sample.parameters import scene_parameters
from cfem.sample.spec import ParameterSpec


@dataclass(frozen=True)
class Lab:
    """A laboratory that a spec names, loaded once.

    spec:       of the cases
    scene_path: of the scene
    scene, mesh: of the robot
    units:      of the force of each actuator"""

    spec: CasesSpec
    scene_path: Path
    scene: SceneSpec
    mesh: Mesh
    units: dict[str, str]

    @property
    def actuators(self) -> list[str]:
        """Names of the actuators."""
        return [actuator.name for actuator in self.scene.actuators]

    @property
    def markers(self) -> list[str]:
        """Names of the markers."""
        return list(self.spec.markers)

    @property
    def down(self) -> np.ndarray | None:
        """Direction (3,) of gravity, None without."""
        return None if self.scene.gravity is None else self.scene.gravity.acceleration

    @property
    def find(self) -> list[str]:
        """Names of the parameters to find."""
        return self.spec.find or list(self.spec.parameters)

    def read(self, path: Path, measured: bool = True) -> Cases:
        """The load cases of a table in the layout of the spec; measured: whether places must be there."""
        units = [self.units[name] for name in self.actuators]
        return read_cases(path, self.spec.layout, self.markers, self.actuators, units, self.scene.length, measured)

    def rig(self, find: Sequence[str], sessions: Sequence[str], discrepancy: DiscrepancyPrior | None = None) -> Rig:
        """The rig with these parameters unknown, and what the model lacks."""
        named = {name: self.spec.parameters[name] for name in find}
        unknowns = case_unknowns(named, self.scene_path, sessions, self.units)
        robots = CaseRobots(self.scene, self.mesh, _keys(unknowns, self.spec, self.scene_path))
        watched = [effector.name for effector in self.scene.effectors]
        markers = list(self.spec.markers.values())
        return Rig(robots, unknowns, markers, watched, self.actuators, sessions, self.spec.offsets, discrepancy)


def load_lab(spec: CasesSpec, base: Path) -> Lab:
    """The laboratory of a spec. SpecError where a marker follows no effector, or stands off one whose turn is not
    watched."""
    from cfem.robot.build import build_robot

    scene_path = base / spec.scene
    scene, mesh = load_scene_and_mesh(scene_path, base / spec.mesh)
    effectors = {effector.name: effector for effector in scene.effectors}
    for name, marker in spec.markers.items():
        where = f"markers.{name}"
        if marker.effector not in effectors:
            what = f"follows '{marker.effector}', and the scene's effectors are {', '.join(effectors)}"
            raise SpecError(what, where=where, do="name one of them")
        if (marker.stand_off is not None or spec.offsets) and not effectors[marker.effector].orientation:
            what = f"stands off effector '{marker.effector}', whose turn the scene does not watch"
            raise SpecError(what, where=where, do="set `orientation: true` of the effector")
    robot = build_robot(scene, mesh)
    units = {name: actuator.units[1] for name, actuator in zip(robot.rows.actuators, robot.actuators, strict=True)}
    return Lab(spec, scene_path, scene, mesh, units)


def _keys(unknowns: Sequence[CaseUnknown], spec: CasesSpec, scene: Path) -> list[Parameter]:
    """A parameter for each key of the scene, in the order of the unknowns."""
    asked = [(unknown.name, key) for unknown in unknowns if unknown.of_scene for key in unknown.keys]
    specs = [{name: ParameterSpec(key=key, range=spec.parameters[name].range)} for name, key in asked]
    return [replace(scene_parameters(parameter, scene)[0], exact=False) for parameter in specs]
