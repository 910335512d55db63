"""Whether models are of the robot of the scene."""

from collections.abc import Mapping
from pathlib import Path

from cfem.core.errors import InputError
from cfem.equilibrium.system.robot import Robot
from cfem.predict.protocol import Predictor


def demand_same_rows(robot: Robot, predictors: Mapping[str, Predictor], models: Mapping[str, Path]) -> None:
    for name, predictor in predictors.items():
        if predictor.rows != robot.rows:
            what = f"is a model of another robot: it {predictor.rows.difference(robot.rows, 'the scene')}"
            raise InputError(what, where=str(models[name]), do="train a model on samples of this scene")
