"""The kinds of spec that there are, by the names of their models: which file is meant for which command."""

from collections.abc import Iterable
from importlib import import_module
from typing import Any

# A pipeline file (scene.yaml, train-mlp.yaml, ...) begins with the name of its kind: module, model, command.
KINDS = {
    "scene": ("cfem.robot.spec", "SceneSpec", "mesh"),
    "sample": ("cfem.sample.spec", "SampleSpec", "simulate-sample"),
    "train": ("cfem.surrogate.spec", "TrainSpec", "train"),
    "export": ("cfem.export.spec", "ExportSpec", "export"),
    "simulate": ("cfem.motion.spec", "SimulateSpec", "simulate"),
    "control": ("cfem.control.spec", "ControlSpec", "control"),
    "calibrate": ("cfem.calibrate.spec", "CalibrateSpec", "calibrate"),
    "estimate": ("cfem.estimation.spec", "EstimateSpec", "estimate"),
    "measurements": ("cfem.measurements.spec", "MeasurementsSpec", "measurements"),
    "cases": ("cfem.cases.spec", "CasesSpec", "calibrate-cases"),
    "predict": ("cfem.cases.prediction.spec", "PredictSpec", "predict-cases"),
    "design": ("cfem.design.spec", "DesignSpec", "optimize-design"),
    "report": ("cfem.report.spec", "ReportSpec", "report"),
}


def model_of(kind: str) -> Any:
    module, name, _ = KINDS[kind]
    return getattr(import_module(module), name)


def other_kind(keys: Iterable[str], wanted: type) -> str | None:
    """What a document with these top-level keys is, in words, where it is no `wanted` and fits another kind."""
    keys, mine = set(keys), next((kind for kind, (_, name, _) in KINDS.items() if name == wanted.__name__), None)
    if mine is None or keys <= set(wanted.model_fields):
        return None
    for kind, (_, _, command) in KINDS.items():
        fields = model_of(kind).model_fields
        if kind != mine and {name for name, field in fields.items() if field.is_required()} <= keys <= set(fields):
            return f"is a {kind} spec, which `cfem {command}` reads; `cfem {KINDS[mine][2]}` reads a {mine} spec"
    return None
