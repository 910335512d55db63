"""From a spec to the rig and the cases that it describes."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cfem.cases.rig import Rig
from cfem.cases.robots import CaseRobots
from cfem.cases.spec import CasesSpec
from cfem.cases.table import Cases, read_cases
from cfem.cases.unknowns import Sought, sought
from cfem.condensed.parameters import Parameter
from cfem.core.errors import SpecError
from cfem.mechanics.mesh import Mesh
from cfem.robot.load import load_scene_and_mesh
from cfem.robot.spec import SceneSpec
from cfem.sample.parameters import scene_parameters
from cfem.sample.spec import ParameterSpec


@dataclass(frozen=True)
class Lab:
    """What a spec names, loaded once."""

    spec: CasesSpec
    scene_path: Path
    scene: SceneSpec
    mesh: Mesh
    units: dict[str, str]

    @property
    def actuators(self) -> list[str]:
        return [one.name for one in self.scene.actuators]

    @property
    def markers(self) -> list[str]:
        return list(self.spec.markers)

    @property
    def down(self) -> np.ndarray | None:
        """(3,) along gravity, None without."""
        return None if self.scene.gravity is None else self.scene.gravity.acceleration

    def read(self, path: Path, measured: bool = True) -> Cases:
        """A table in the layout of the spec."""
        units = [self.units[name] for name in self.actuators]
        return read_cases(path, self.spec.layout, self.markers, self.actuators, units, self.scene.length, measured)

    def rig(self, find: Sequence[str], sessions: Sequence[str]) -> Rig:
        """With these parameters unknown."""
        asked = {name: self.spec.parameters[name] for name in find}
        unknowns = sought(asked, self.scene_path, sessions, self.units)
        robots = CaseRobots(self.scene, self.mesh, _keys(unknowns, self.spec, self.scene_path))
        watched = [one.name for one in self.scene.effectors]
        return Rig(
            robots, unknowns, list(self.spec.markers.values()), watched, self.actuators, sessions, self.spec.offsets
        )

    @property
    def find(self) -> list[str]:
        return self.spec.find or list(self.spec.parameters)


def load_lab(spec: CasesSpec, base: Path) -> Lab:
    """SpecError where a marker follows no effector, or stands off one whose turn is not watched."""
    from cfem.robot.build import build_robot

    scene_path = base / spec.scene
    scene, mesh = load_scene_and_mesh(scene_path, base / spec.mesh)
    effectors = {one.name: one for one in scene.effectors}
    for name, marker in spec.markers.items():
        where = f"markers.{name}"
        if marker.effector not in effectors:
            what = f"follows '{marker.effector}', and the scene's effectors are {', '.join(effectors)}"
            raise SpecError(what, where=where, do="name one of them")
        if (marker.stand_off is not None or spec.offsets) and not effectors[marker.effector].orientation:
            what = f"stands off effector '{marker.effector}', whose turn the scene does not watch"
            raise SpecError(what, where=where, do="set `orientation: true` of the effector")
    robot = build_robot(scene, mesh)
    units = {name: one.units[1] for name, one in zip(robot.rows.actuators, robot.actuators, strict=True)}
    return Lab(spec, scene_path, scene, mesh, units)


def _keys(unknowns: Sequence[Sought], spec: CasesSpec, scene: Path) -> list[Parameter]:
    """One for each key of the scene, in the order of the unknowns."""
    made = []
    for one in unknowns:
        if one.of_scene:
            for key in one.keys:
                asked = {one.name: ParameterSpec(key=key, range=spec.parameters[one.name].range)}
                made.append(scene_parameters(asked, scene)[0])
    return [Parameter(**{**vars(one), "exact": False}) for one in made]
