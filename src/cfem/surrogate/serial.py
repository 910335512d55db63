"""Modules in a row from a trained model of one (predict/serial.py): nothing is fitted, the dataset judges."""

from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.errors import InputError
from cfem.predict.load import build, read_model
from cfem.surrogate.spec import SerialSpec

_END = ("x", "y", "z", "rx", "ry", "rz")


def compose(
    training: Any, spec: SerialSpec, folder: Path
) -> tuple[dict[str, np.ndarray], dict[str, Any], list[dict[str, Any]]]:
    """Arrays, what model.json says of them, and how the module's model learned. folder: of the module's model.
    InputError where it does not fit the whole: other effectors, or another number of actuators."""
    meta, arrays = read_model(folder)
    history = meta.pop("history")
    module = build(meta, arrays)
    axes = tuple(name.rsplit(".", 1)[-1] for name in module.rows.effectors)
    if axes != _END or module.form != "displacement" or module.parameters:
        raise InputError(
            f"must be of form displacement, of one end with its orientation ({', '.join(_END)}), without parameters; "
            f"it is of form {module.form}, of {', '.join(module.rows.effectors)}",
            where=str(folder),
            do="sample a scene of one module whose effector has `orientation: true`",
        )
    whole = training.rows
    if len(whole.effectors) != 3 or whole.n_a != len(spec.softer) * module.rows.n_a:
        raise InputError(
            f"{len(spec.softer)} modules of {module.rows.n_a} actuators do not make a robot of {whole.n_a} actuators "
            f"and effectors {', '.join(whole.effectors)}",
            where=str(folder),
        )
    facts = {"form": "displacement", "module": meta, "softer": list(spec.softer)}
    return arrays, {**facts, "samples": meta["dataset"].get("samples", 0)}, history
