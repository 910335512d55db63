"""JSON Schemas of the specs, from the same models that validate them."""

import json
from importlib import import_module
from pathlib import Path

from cfem.core.errors import GateError
from cfem.core.files import write_whole
from cfem.core.spec import Spec, json_schema

# pipeline file (scene.yaml, train-mlp.yaml, ...) begins with the name of its schema
SPECS = {
    "scene": ("cfem.robot.spec", "SceneSpec"),
    "sample": ("cfem.sample.spec", "SampleSpec"),
    "train": ("cfem.surrogate.spec", "TrainSpec"),
    "export": ("cfem.export.spec", "ExportSpec"),
    "control": ("cfem.control.spec", "ControlSpec"),
    "calibrate": ("cfem.calibrate.spec", "CalibrateSpec"),
    "design": ("cfem.design.spec", "DesignSpec"),
    "report": ("cfem.report.spec", "ReportSpec"),
}


def model_of(name: str) -> type[Spec]:
    """Of the spec `name`.yaml."""
    module, model = SPECS[name]
    return getattr(import_module(module), model)


def schemas() -> dict[str, str]:
    """File name -> text."""
    found = {}
    for name in SPECS:
        schema = json_schema(model_of(name))
        found[f"{name}.json"] = json.dumps(schema, indent=1, sort_keys=True) + "\n"
    return found


def write_schemas(out: Path, check: bool) -> str:
    """Writes all; with `check` writes none and raises GateError where one differs."""
    for name, text in schemas().items():
        path = out / name
        if check and (not path.exists() or path.read_text() != text):
            raise GateError("differs from the specs", where=str(path), do="run cfem schema")
        if not check:
            write_whole(path, text.encode())
    return f"{len(SPECS)} schemas {'are current' if check else 'written'} in {out}"
