"""One robot of a family: its FE model and the learned models at its parameters."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cfem.condensed.parameters import Parameter, sampled, vector
from cfem.core.errors import SpecError
from cfem.equilibrium.system.robot import Robot
from cfem.mechanics.mesh import Mesh
from cfem.predict.at_parameters import AtParameters
from cfem.predict.protocol import Predictor
from cfem.robot.spec import SceneSpec
from cfem.sample.family import RobotFamily
from cfem.sample.parameters import with_values


def designed(
    scene: SceneSpec, mesh: Mesh, predictors: Mapping[str, Predictor], design: Mapping[str, Any]
) -> tuple[Robot, dict[str, AtParameters], np.ndarray]:
    """FE robot of the design, the models bound to it, and how far its effectors rest (n_e,) mm from where the scene's
    own do. SpecError where the models differ in their parameters."""
    first, *others = predictors.values()
    if any(model.parameters != first.parameters for model in others):
        raise SpecError("the models have different parameters", where="design", do="name models of the same parameters")
    p = vector(first.parameters, design, "design")
    robot, scene_robot = robot_at(scene, mesh, first.parameters, p)
    return (
        robot,
        {name: AtParameters(model, p) for name, model in predictors.items()},
        robot.rest_e - scene_robot.rest_e,
    )


def robot_at(scene: SceneSpec, mesh: Mesh, parameters: Sequence[Parameter], p: np.ndarray) -> tuple[Robot, Robot]:
    """FE robot of parameters p (n_p,), and the scene's own with their exact ones."""
    learned = [not parameter.exact for parameter in parameters]
    exact = [parameter.key for parameter in parameters if parameter.exact]
    scene = with_values(scene, exact, p[[parameter.exact for parameter in parameters]])
    family = RobotFamily(scene, mesh, sampled(parameters))
    return family.at(p[learned]), family.robot
