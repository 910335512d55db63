"""The kinds of spec that there are, by the names of their models: which file is meant for which command."""

import sys
from collections.abc import Iterable
from importlib import import_module
from typing import Any, get_args

from pydantic import BaseModel

# A pipeline file (scene.yaml, train-mlp.yaml, ...) begins with the name of its kind: module, model, command.
KINDS = {
    "scene": ("cfem.robot.spec", "SceneSpec", "mesh"),
    "sample": ("cfem.sample.spec", "SampleSpec", "sample"),
    "train": ("cfem.surrogate.spec", "TrainSpec", "train"),
    "export": ("cfem.export.spec", "ExportSpec", "export"),
    "simulate": ("cfem.motion.spec", "SimulateSpec", "simulate"),
    "control": ("cfem.control.spec", "ControlSpec", "control"),
    "calibrate": ("cfem.identify.robot.spec", "CalibrateSpec", "calibrate"),
    "estimate": ("cfem.identify.states.spec", "EstimateSpec", "estimate"),
    "measurements": ("cfem.identify.recordings.spec", "MeasurementsSpec", "measurements"),
    "cases": ("cfem.identify.cases.spec", "CasesSpec", "calibrate-cases"),
    "predict": ("cfem.identify.cases.prediction.spec", "PredictSpec", "predict-cases"),
    "design": ("cfem.design.spec", "DesignSpec", "optimize-design"),
    "report": ("cfem.report.spec", "ReportSpec", "report"),
}

# What a command was called before, by its name: still an alias of it, the name in old manifests, and in every hash of
# what its results were made from, so that old results, parts and unfinished work stay what they are.
FORMER = {"sample": "simulate-sample"}
_PRESENT = {former: name for name, former in FORMER.items()}


def present(command: str) -> str:
    """The name that a command has now."""
    return _PRESENT.get(command, command)


def model_of(kind: str) -> Any:
    module, name, _ = KINDS[kind]
    return getattr(import_module(module), name)


def classes_of(model: Any) -> tuple[type, ...]:
    """The classes of a model: itself, or those of an annotated union."""
    if isinstance(model, type):
        return (model,) if issubclass(model, BaseModel) else ()
    return tuple(member for part in get_args(model) for member in classes_of(part))


def other_kind(keys: Iterable[str], wanted: Any) -> str | None:
    """Kind of a document with these top-level keys, in words, where it is no `wanted` and fits another kind."""
    keys, wanted_kind = set(keys), _kind_of(wanted)
    if wanted_kind is None or any(keys <= set(model.model_fields) for model in classes_of(wanted)):
        return None
    for kind, (_, _, command) in KINDS.items():
        if kind != wanted_kind and any(_fits(keys, model) for model in classes_of(model_of(kind))):
            reader = KINDS[wanted_kind][2]
            return f"is a {kind} spec, which `cfem {command}` reads; `cfem {reader}` reads a {wanted_kind} spec"
    return None


def _kind_of(model: Any) -> str | None:
    """The kind whose model this is; its module has been imported."""
    loaded = {kind: getattr(sys.modules.get(module), name, None) for kind, (module, name, _) in KINDS.items()}
    return next((kind for kind, known in loaded.items() if known is model), None)


def _fits(keys: set[str], model: Any) -> bool:
    """True if a document with these keys could be of a model."""
    fields = model.model_fields
    return {name for name, field in fields.items() if field.is_required()} <= keys <= set(fields)
