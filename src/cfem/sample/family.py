"""One robot for each value of the parameters, built from what they leave alone."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cfem.condensed.parameters import Parameter, coordinates, sampled, values
from cfem.equilibrium.robot import Robot
from cfem.mechanics.body import with_materials
from cfem.mechanics.mesh import Mesh
from cfem.robot.build import build_robot, materials_of, with_actuator
from cfem.robot.deform import Deformation
from cfem.robot.designs import Designs
from cfem.robot.on_mesh import on_mesh
from cfem.robot.spec import SceneSpec
from cfem.sample.parameters import range_coordinates, with_values


class RobotFamily:
    """The robots of one scene and mesh, one for each p; what p leaves alone is built once.

    parameters: the sampled ones; robot: the scene's own; alike: whether all have the same pattern of unknowns, as only
    moduli vary from robot to robot, or places of nodes"""

    def __init__(self, scene: SceneSpec, mesh: Mesh, parameters: Sequence[Parameter]):
        self.parameters = sampled(parameters)
        kinds = {one.key.partition(".")[0] for one in self.parameters}
        self._designs = Designs(scene, mesh) if "geometry" in kinds else None
        self.robot = self._designs.reference if self._designs else build_robot(scene, mesh)
        dense = any(one.key.endswith("density") for one in self.parameters)
        self._built_anew = not self._designs and (dense or not kinds <= {"material", "materials", "shape"})
        self.alike = not self._built_anew
        self._scene, self._mesh = scene, mesh
        self._form = None
        if "shape" in kinds and not self._designs:
            self._form = Deformation(scene.shape, mesh.base)
            self._unshaped = build_robot(scene.model_copy(update={"shape": None}), mesh.base)

    def at(self, p: np.ndarray) -> Robot:
        """p: (n_p,) values."""
        if not self.parameters:
            return self.robot
        scene = with_values(self._scene, [one.key for one in self.parameters], p)
        if self._designs:
            return self._designs.robot(scene)
        mesh = self._form(scene.shape, self._mesh.base) if self._form else self._mesh
        if self._built_anew:
            return build_robot(scene, mesh)
        robot = self._unshaped if self._form else self.robot
        robot = replace(robot, body=with_materials(robot.body, materials_of(scene)))
        return on_mesh(scene, robot, mesh) if self._form else robot

    def around(self, p: np.ndarray, index: int, step: float, at: Robot | None = None) -> tuple[Robot, Robot, float]:
        """The robots on either side of p in the coordinate of parameter `index`, `step` of its range away, and by how
        much that coordinate differs between them. at: the robot of p itself, of which they then keep what the parameter
        leaves alone."""
        low, high = range_coordinates(self.parameters)
        middle = coordinates(self.parameters, p)
        shift = step * (high - low) * (np.arange(len(p)) == index)
        behind, ahead = (values(self.parameters, middle + sign * shift) for sign in (-1, 1))
        behind, ahead = (self.at(one) if at is None else self._beside(one, index, at) for one in (behind, ahead))
        return behind, ahead, float(2 * shift[index])

    def _beside(self, p: np.ndarray, index: int, at: Robot) -> Robot:
        """At p, which differs from that of the robot `at` in one parameter."""
        kind, *key = self.parameters[index].key.split(".")
        if self._built_anew and not self._form:
            scene = with_values(self._scene, [one.key for one in self.parameters], p)
            if kind in ("material", "materials") and key[-1] != "density":
                return replace(at, body=with_materials(at.body, materials_of(scene)))
            if kind == "actuators":
                return with_actuator(scene, self._mesh, at, int(key[0]))
        return self.at(p)
