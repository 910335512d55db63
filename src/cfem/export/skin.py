"""The skin in every format: skin.npz beside the model, and, where shapes are asked for, shape.onnx, shape.ts and
cfem_shape in C, each compared with the trained skin."""

import warnings
from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.artefact.files import write_npz, write_whole
from cfem.core.errors import InputError
from cfem.export.firmware.row import more_than_series
from cfem.export.spec import ExportSpec
from cfem.predict.load import build, skin_of, skins_of
from cfem.predict.protocol import Predictor
from cfem.predict.rows import serial_skin
from cfem.predict.rows.serial import SerialPredictor
from cfem.predict.series.skin import FILE

SHAPES = {"onnx": "shape.onnx", "torchscript": "shape.ts"}
STATES = 20  # at which shapes are compared


def write_skin(
    folder: Path, spec: ExportSpec, meta: dict, arrays: dict[str, np.ndarray], skin: dict, vectors: dict
) -> dict[str, float]:
    """Writes what the spec asks for; skin: arrays of `cfem.predict.series.skin`. By format, the largest difference of
    any surface node from the trained skin relative to the robot's length, at test inputs."""
    write_npz(folder / FILE, skin)
    if not spec.shape:
        return {}
    model = build(meta, arrays)
    s, p = vectors["s"][:STATES], vectors["p"][:STATES]
    graphs = {name: file for name, file in SHAPES.items() if name in spec.formats}
    surfaces = _graphs(folder, graphs, meta, skin, s, p) if graphs else {}
    trained = skin_of(model, skin)
    length, inputs = model.length, s * model.softer(p)[:, None] if meta["parameters"] and model.form == "force" else s
    expected = trained.surface(trained.rows(inputs, model.q(p if meta["parameters"] else None)))
    parity = {name: float(np.abs(x - expected).max()) / length for name, x in surfaces.items()}
    if "c" in spec.formats:
        parity |= _c(folder / "c", spec, model, skin, s)
    return {f"{name} shape": value for name, value in parity.items()}


def _graphs(folder: Path, graphs: dict[str, str], meta: dict, skin: dict, s: np.ndarray, p: np.ndarray) -> dict:
    """Positions (m, nodes, 3) by format, from the files written."""
    from cfem.export.onnx import example, onnx_bytes
    from cfem.export.torchscript import torchscript_bytes
    from cfem.surrogate.modules import shape_module

    module, given = shape_module(meta, skin), ((s, p) if meta["parameters"] else (s,))
    surfaces: dict[str, Any] = {}
    if "onnx" in graphs:
        import onnxruntime

        data = onnx_bytes(module, meta, ("x",))
        write_whole(folder / graphs["onnx"], data)
        session = onnxruntime.InferenceSession(data, providers=["CPUExecutionProvider"])
        names = [tensor.name for tensor in session.get_inputs()]
        surfaces["onnx"] = session.run(["x"], dict(zip(names, given, strict=True)))[0]
    if "torchscript" in graphs:
        import torch

        write_whole(folder / graphs["torchscript"], torchscript_bytes(module, example(meta)))
        with warnings.catch_warnings(), torch.no_grad():
            warnings.simplefilter("ignore", DeprecationWarning)
            loaded = torch.jit.load(folder / graphs["torchscript"])
            surfaces["torchscript"] = loaded(*map(torch.as_tensor, given)).numpy()
    return surfaces


def _c(folder: Path, spec: ExportSpec, model: Predictor, skin: dict, s: np.ndarray) -> dict[str, float]:
    """Adds the skin to the C folder; its difference from the trained one at states s, where there is a compiler."""
    from cfem.export.compiled.build import compiler
    from cfem.export.compiled.shape import CompiledShape
    from cfem.export.firmware.folder import at_robot
    from cfem.export.firmware.skin import write_c_skin

    write_c_skin(folder, model, skin, spec.c)
    if not compiler():
        return {}
    p, s = at_robot(model, spec.c, s)
    trained, shape = skin_of(model, skin), CompiledShape(folder)
    inputs = s * model.softer(p) if p is not None and model.form == "force" else s
    expected = trained.surface(trained.rows(inputs, np.broadcast_to(model.q(p), (len(s), model.q(p).shape[-1]))))
    return {"c": float(np.abs(np.array([shape(state) for state in s]) - expected).max()) / model.length}


def write_row_skin(
    folder: Path, spec: ExportSpec, row: SerialPredictor, skins: dict[str, np.ndarray], vectors: dict
) -> dict[str, float]:
    """Writes what the spec asks for of modules in a row, which have a shape from arrays and in C; skins: arrays of
    their models. InputError for other formats."""
    write_npz(folder / serial_skin.FILE, skins)
    if not spec.shape:
        return {}
    unsupported = next((name for name in SHAPES if name in spec.formats), None)
    if unsupported or ("c" in spec.formats and more_than_series(row)):
        alone = "under loads, of different models or with a centre of mass have a shape in Python alone"
        what = f"have no shape in format {unsupported}" if unsupported else alone
        raise InputError(f"modules in a row {what}", where="shape", do="leave `shape` out, or export `arrays` and `c`")
    if "c" not in spec.formats:
        return {}
    from cfem.export.compiled.build import compiler
    from cfem.export.compiled.shape import CompiledShape
    from cfem.export.firmware.skin import write_c_row_skin

    row.skin_source = lambda: skins_of(row, skins)
    write_c_row_skin(folder / "c", row, spec.c)
    if not compiler():
        return {}
    s, shape = vectors["s"][:STATES], CompiledShape(folder / "c")
    return {"c shape": float(np.abs(np.array([shape(state) for state in s]) - row.shape(s)).max()) / row.length}
