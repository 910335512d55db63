"""Condensed finite-element models of soft robots: sampled, learned, exported, controlled.

Units everywhere: mm, N, MPa, s, rad. Every error is a `CfemError`. Names are loaded when they are first used."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from cfem.core.version import VERSION as __version__

if TYPE_CHECKING:  # for editors and type checkers; the table below says the same to Python
    from cfem.api.artefacts import load_model as load_model
    from cfem.api.artefacts import read_dataset as read_dataset
    from cfem.api.artefacts import run_folder as run_folder
    from cfem.api.artefacts import run_stage as run_stage
    from cfem.api.control import find_actuation as find_actuation
    from cfem.api.control import inverse_step as inverse_step
    from cfem.api.control import make_controller as make_controller
    from cfem.api.robot import load_robot as load_robot
    from cfem.api.robot import solve as solve
    from cfem.core.errors import CfemError as CfemError
    from cfem.core.errors import DiskError as DiskError
    from cfem.core.errors import GateError as GateError
    from cfem.core.errors import InputError as InputError
    from cfem.core.errors import NumericalError as NumericalError
    from cfem.core.errors import OutputError as OutputError
    from cfem.core.errors import SpecError as SpecError
    from cfem.plant.fem_plant import FemPlant as FemPlant
    from cfem.plant.model_plant import ModelPlant as ModelPlant

_NAMES = {
    "cfem.api.robot": "load_robot solve",
    "cfem.api.artefacts": "run_stage run_folder read_dataset load_model",
    "cfem.api.control": "inverse_step find_actuation make_controller",
    "cfem.plant.fem_plant": "FemPlant",
    "cfem.plant.model_plant": "ModelPlant",
    "cfem.core.errors": "CfemError SpecError InputError NumericalError GateError OutputError DiskError",
}
_HOME = {name: module for module, names in _NAMES.items() for name in names.split()}
__all__ = [*_HOME, "__version__"]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'cfem' has no attribute '{name}'")
    from cfem.core.optional import says_what_is_missing

    globals()[name] = getattr(says_what_is_missing(import_module)(_HOME[name]), name)
    return globals()[name]


def __dir__() -> list[str]:
    return __all__
