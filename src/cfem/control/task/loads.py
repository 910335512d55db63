"""Constant loads in control: the learned models take them, and the FE robot carries them."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from cfem.constraint.patch import PatchLoad
from cfem.control.task.run_spec import LoadedSpec
from cfem.core.artefact.judgement import poor
from cfem.core.errors import InputError
from cfem.equilibrium.contact.patch_effectors import PatchYield
from cfem.equilibrium.system.robot import Robot
from cfem.plant.fem_plant import pushed
from cfem.predict.at_parameters import AtParameters
from cfem.predict.contact.surface.kept_patches import yield_of
from cfem.predict.loads.loaded import loaded, wrench_of
from cfem.predict.loads.spec import LoadSpec, loads_of
from cfem.predict.protocol import Predictor
from cfem.robot.checks.plausible import gravity_doubts
from cfem.robot.load import made_from


def carrying(
    spec: LoadedSpec, base: Path, robot: Robot, predictors: Mapping[str, Predictor], models: Mapping[str, Path]
) -> tuple[Robot, dict[str, Predictor]]:
    """Robot and models under the loads of the spec. A model that was exported under loads must have the same.
    InputError where a model cannot take them."""
    wrench, patches = _loads(spec, robot)
    made_of = made_from(base / spec.scene, base / spec.mesh) if patches else {}
    carrying_models = {}
    for name, model in predictors.items():

        def by_fe(model: Predictor = model, folder: Path = models[name]) -> PatchYield | None:
            return yield_of(model, folder, robot, made_of, patches) if patches else None

        carrying_models[name] = _under(wrench, patches, model, str(models[name]), by_fe)
    return under_loads(spec, robot), carrying_models


def load_doubts(loads: Mapping[str, LoadSpec]) -> list[dict[str, Any]]:
    """Findings that make a run poor: gravity in another unit."""
    return [
        poor(sentence)
        for name, load in loads.items()
        if load.gravity is not None
        for sentence in gravity_doubts(load.gravity, f"loads.{name}.gravity")
    ]


def under_loads(spec: LoadedSpec, robot: Robot) -> Robot:
    """The FE robot under the loads of the spec."""
    return pushed(robot, *_loads(spec, robot)) if spec.loads else robot


def _loads(spec: LoadedSpec, robot: Robot) -> tuple[np.ndarray, tuple[PatchLoad, ...]]:
    """Loads of the spec: (n_e,) N on the effector rows, and those on patches of the surface."""
    forces, patches = loads_of(spec.loads, robot.masses)
    return wrench_of(robot.rows, forces), patches


def _under(
    wrench: np.ndarray,
    patches: tuple[PatchLoad, ...],
    model: Predictor | AtParameters,
    where: str,
    by_fe: Callable[[], PatchYield | None],
) -> Predictor | AtParameters:
    """Model under these loads; as it is where it was exported under the same. InputError where it has others."""
    meta = (model.predictor if isinstance(model, AtParameters) else model).meta
    if meta.get("wrench") is not None:
        exported = np.asarray(meta["wrench"]), tuple(PatchLoad(**load) for load in meta.get("patch_loads") or ())
        same = len(exported[1]) == len(patches) and np.allclose(exported[0], wrench, rtol=1e-9, atol=0.0)
        if same and all(load.same(stated) for load, stated in zip(exported[1], patches, strict=True)):
            return model
        what = f"was exported under loads of {_listed(*exported)}; the spec has {_listed(wrench, patches)}"
        raise InputError(what, where=where, do="state the same loads, or take the export without loads")
    if not wrench.any() and not patches:
        return model
    try:
        return loaded(model, wrench, patches, by_fe())
    except InputError as error:
        raise InputError(error.what, where=where, do=error.do) from None


def _listed(wrench: np.ndarray, patches: tuple[PatchLoad, ...]) -> str:
    rows = f"{', '.join(f'{force:g}' for force in wrench)} on its effector rows"
    return " and ".join([rows, *(str(load) for load in patches)])
