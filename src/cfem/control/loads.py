"""Constant loads on effectors in control: the learned models take them, and the FE robot carries them."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from cfem.control.spec import ControlSpec
from cfem.core.errors import InputError
from cfem.equilibrium.robot import Robot
from cfem.plant.fem_plant import pushed
from cfem.predict.at_parameters import AtParameters
from cfem.predict.load_spec import forces_of
from cfem.predict.loaded import loaded, wrench_of
from cfem.predict.protocol import Predictor


def carrying(
    spec: ControlSpec, robot: Robot, predictors: Mapping[str, Predictor], models: Mapping[str, Path]
) -> tuple[Robot, dict[str, Predictor]]:
    """Robot and models under the loads of the spec. A model that was exported under loads must have the same.
    InputError where a model cannot take them."""
    wrench = _wrench(spec, robot)
    found = {name: _under(wrench, model, str(models[name])) for name, model in predictors.items()}
    return under_loads(spec, robot), found


def under_loads(spec: ControlSpec, robot: Robot) -> Robot:
    """The FE robot under the loads of the spec."""
    return pushed(robot, _wrench(spec, robot)) if spec.loads else robot


def _wrench(spec: ControlSpec, robot: Robot) -> np.ndarray:
    return wrench_of(robot.rows, forces_of(spec.loads, robot.masses))


def _under(wrench: np.ndarray, model: Predictor | AtParameters, where: str) -> Predictor | AtParameters:
    own = (model.predictor if isinstance(model, AtParameters) else model).meta.get("wrench")
    if own is not None:
        if np.allclose(own, wrench, rtol=1e-9, atol=0.0):
            return model
        what = f"was exported under loads of {_listed(own)} on its effector rows; the spec has {_listed(wrench)}"
        raise InputError(what, where=where, do="state the same loads, or take the export without loads")
    if not wrench.any():
        return model
    try:
        return loaded(model, wrench)
    except InputError as error:
        raise InputError(error.what, where=where, do=error.do) from None


def _listed(wrench: np.ndarray) -> str:
    return ", ".join(f"{one:g}" for one in wrench)
