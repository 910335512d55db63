"""One robot for each value of the parameters, built from what they leave alone."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cfem.condensed.parameters import Parameter, coordinates, range_coordinates, sampled, values
from cfem.equilibrium.system.robot import Robot
from cfem.mechanics.body import with_materials
from cfem.mechanics.mesh import Mesh
from cfem.robot.build import build_robot, materials_of, with_actuator
from cfem.robot.shape.deform import Deformation
from cfem.robot.shape.designs import Designs
from cfem.robot.shape.on_mesh import on_mesh
from cfem.robot.spec import SceneSpec
from cfem.sample.parameters import with_values

_MOVES_BASE = ("geometry", "actuators", "effectors")  # keys of what moves a mesh before its free form
# Surfaces and places are smooth functions of parameters, in closed form: differenced over this share of a range.
# Shorter, their rounding would move nodes where surfaces meet at small angles.
_SHORT = 2e-3


class RobotFamily:
    """The robots of one scene and mesh, one for each p; what p leaves alone is built once.

    parameters: the sampled ones; robot: the scene's own; alike: whether all have the same pattern of unknowns, as only
    moduli vary from robot to robot, or places of nodes"""

    def __init__(self, scene: SceneSpec, mesh: Mesh, parameters: Sequence[Parameter]):
        """Robots of a scene whose parameters differ."""
        self.parameters = sampled(parameters)
        kinds = {parameter.key.partition(".")[0] for parameter in self.parameters}
        self._designs = Designs(scene, mesh) if "geometry" in kinds else None
        self.robot = self._designs.reference if self._designs else build_robot(scene, mesh)
        dense = any(parameter.key.endswith("density") for parameter in self.parameters)
        self._built_anew = not self._designs and (dense or not kinds <= {"material", "materials", "shape"})
        self.alike = not self._built_anew
        self._scene, self._mesh = scene, mesh
        self._keys = [parameter.key for parameter in self.parameters]
        self._moving: tuple[bytes, dict[int, np.ndarray]] = (b"", {})
        self._form = None
        if "shape" in kinds and not self._designs:
            self._form = Deformation(scene.shape, mesh.base)
            self._unshaped = build_robot(scene.model_copy(update={"shape": None}), mesh.base)

    def at(self, p: np.ndarray) -> Robot:
        """Robot with parameters p (n_p,)."""
        if not self.parameters:
            return self.robot
        scene = with_values(self._scene, self._keys, p)
        if self._designs:
            return self._designs.robot(scene)
        mesh = self._form(scene.shape, self._mesh.base) if self._form else self._mesh
        if self._built_anew:
            return build_robot(scene, mesh)
        robot = self._unshaped if self._form else self.robot
        robot = replace(robot, body=with_materials(robot.body, materials_of(scene)))
        return on_mesh(scene, robot, mesh) if self._form else robot

    def around(
        self, p: np.ndarray, index: int, step: float, robot_at_p: Robot | None = None
    ) -> tuple[Robot, Robot, float]:
        """Robots on either side of p in the coordinate of parameter `index`, `step` of its range away, and the
        difference of that coordinate between them. robot_at_p: of which they then keep what the parameter leaves
        alone."""
        low, high = range_coordinates(self.parameters)
        middle = coordinates(self.parameters, p)
        shift = step * (high - low) * (np.arange(len(p)) == index)
        ends = [values(self.parameters, middle + sign * shift)[index] for sign in (-1, 1)]
        scene = with_values(self._scene, self._keys, p)
        scenes = [with_values(scene, self._keys[index : index + 1], [end]) for end in ends]
        if self._designs:
            behind, ahead = self._designed(scene, p, index, shift[index], scenes, robot_at_p)
        else:
            behind, ahead = (
                self._beside(p, index, end, scene_beside, robot_at_p)
                for end, scene_beside in zip(ends, scenes, strict=True)
            )
        return behind, ahead, float(2 * shift[index])

    def _designed(
        self,
        scene: SceneSpec,
        p: np.ndarray,
        index: int,
        shift: float,
        scenes: list[SceneSpec],
        robot_at_p: Robot | None,
    ) -> list[Robot]:
        """Robots on either side of p, of designs: the nodes move along their derivative."""
        if robot_at_p is not None and self._of_stiffness(index):
            return [
                replace(robot_at_p, body=with_materials(robot_at_p.body, materials_of(scene_beside)))
                for scene_beside in scenes
            ]
        if self._moving[0] != p.tobytes():
            self._moving = p.tobytes(), self._moves(scene, p)
        move = self._moving[1].get(index)
        base = self._designs.base(scene)
        sides = [0.0, 0.0] if move is None else [-shift * move, shift * move]
        return [
            self._designs.beside(scene_beside, base, side) for scene_beside, side in zip(scenes, sides, strict=True)
        ]

    def _moves(self, scene: SceneSpec, p: np.ndarray) -> dict[int, np.ndarray]:
        """Derivatives of the nodes, (n, 3) mm a unit of its coordinate, by the number of each parameter that moves the
        mesh before its free form."""
        low, high = range_coordinates(self.parameters)
        middle = coordinates(self.parameters, p)
        moving = [i for i, key in enumerate(self._keys) if key.startswith(_MOVES_BASE)]
        sums = []
        for i in moving:
            h = _SHORT * (high - low)[i]
            ends = [values(self.parameters, middle + side * h * (np.arange(len(p)) == i))[i] for side in (-1, 1)]
            scenes = [with_values(scene, self._keys[i : i + 1], [end]) for end in ends]
            sums.append(list(zip((-1 / (2 * h), 1 / (2 * h)), scenes, strict=True)))
        derivatives = self._designs.changes(scene, sums) if moving else []
        return dict(zip(moving, derivatives, strict=True))

    def _of_stiffness(self, index: int) -> bool:
        kind, *key = self._keys[index].split(".")
        return kind in ("material", "materials") and key[-1] != "density"

    def _beside(self, p: np.ndarray, index: int, end: float, scene: SceneSpec, robot_at_p: Robot | None) -> Robot:
        """Robot of a scene that differs from that of p in one parameter, which has the value `end`. at: the robot of
        p."""
        kind, *key = self._keys[index].split(".")
        if robot_at_p is not None and self._built_anew and not self._form:
            if self._of_stiffness(index):
                return replace(robot_at_p, body=with_materials(robot_at_p.body, materials_of(scene)))
            if kind == "actuators":
                return with_actuator(scene, self._mesh, robot_at_p, int(key[0]))
        return self.at(np.where(np.arange(len(p)) == index, end, p))
