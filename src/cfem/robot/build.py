"""From a scene and its mesh to the robot that mechanics solves."""

import numpy as np

from cfem.condensed import Rows
from cfem.constraint.attachment import attach
from cfem.constraint.cable import Cable, make_cable
from cfem.constraint.effector import make_effector
from cfem.mechanics.element import ELEMENTS
from cfem.mechanics.material import LAWS
from cfem.mechanics.mesh import Mesh
from cfem.mechanics.solid import make_solid
from cfem.robot import spec
from cfem.robot.robot import Robot
from cfem.robot.selection import select_nodes


def build_robot(scene: spec.SceneSpec, mesh: Mesh) -> Robot:
    """Raises SpecError where a point lies outside the body or a selection is empty."""
    element = ELEMENTS[scene.mesh.element]
    law = LAWS[scene.material.law]
    fixed = [select_nodes(mesh, part, f"fixed[{index}]") for index, part in enumerate(scene.fixed)]
    effectors = tuple(
        make_effector(mesh, item.point, item.radius, item.carrier_radius, item.name) for item in scene.effectors
    )
    return Robot(
        name=scene.name,
        body=make_solid(mesh, element, law, scene.material.young, scene.material.poisson),
        fixed=np.unique(np.concatenate(fixed)),
        actuators=tuple(_cable(mesh, item) for item in scene.actuators),
        effectors=effectors,
        rows=Rows(
            effectors=tuple(f"{item.name}.{axis}" for item in scene.effectors for axis in "xyz"),
            actuators=tuple(item.name for item in scene.actuators),
        ),
        reach=np.array([item.reach for item in scene.actuators]),
        unilateral=np.array([item.unilateral for item in scene.actuators]),
        length=scene.length,
    )


def _cable(mesh: Mesh, item: spec.Cable) -> Cable:
    points = [
        attach(mesh, point, item.radius, f"cable '{item.name}' point {index + 1}")
        for index, point in enumerate(item.points)
    ]
    return make_cable(points, item.pull_point, item.name)
