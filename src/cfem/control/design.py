"""One robot of a family: its FE model and the learned models at its parameters."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cfem.condensed.parameter_values import vector
from cfem.condensed.parameters import Parameter, sampled
from cfem.core.errors import SpecError
from cfem.equilibrium.robot import Robot
from cfem.mechanics.mesh import Mesh
from cfem.predict.at_parameters import AtParameters
from cfem.predict.protocol import Predictor
from cfem.robot.spec import SceneSpec
from cfem.sample.family import RobotFamily
from cfem.sample.parameters import with_values


def designed(
    scene: SceneSpec, mesh: Mesh, predictors: Mapping[str, Predictor], design: Mapping[str, Any]
) -> tuple[Robot, dict[str, AtParameters], np.ndarray]:
    """The FE robot of the design, the models bound to it, and how far its effectors rest (n_e,) mm from where the
    scene's own do. SpecError where the models differ in their parameters."""
    first, *others = predictors.values()
    if any(one.parameters != first.parameters for one in others):
        raise SpecError("the models have different parameters", where="design", do="name models of the same parameters")
    p = vector(first.parameters, design, "design")
    robot, own = robot_at(scene, mesh, first.parameters, p)
    return robot, {name: AtParameters(one, p) for name, one in predictors.items()}, robot.rest_e - own.rest_e


def robot_at(scene: SceneSpec, mesh: Mesh, parameters: Sequence[Parameter], p: np.ndarray) -> tuple[Robot, Robot]:
    """The FE robot of parameters p (n_p,), and the scene's own with their exact ones."""
    learned = [not one.exact for one in parameters]
    exact = [one.key for one in parameters if one.exact]
    scene = with_values(scene, exact, p[[one.exact for one in parameters]])
    family = RobotFamily(scene, mesh, sampled(parameters))
    return family.at(p[learned]), family.robot
