"""From a model folder to a predictor."""

import zipfile
from pathlib import Path
from typing import Literal

import numpy as np

from cfem.core.errors import InputError
from cfem.core.files import read_json
from cfem.core.optional import demand
from cfem.core.stage import artefact_file
from cfem.predict import energy_net, mlp, serial, spectral  # noqa: F401  (each joins KINDS)
from cfem.predict.protocol import KINDS, Predictor, build

FORMAT = 3
Runtime = Literal["arrays", "onnx"]


def load_model(folder: Path, runtime: Runtime = "arrays") -> Predictor:
    """The model of a folder that `cfem train` or `cfem export` made. InputError where a file is missing or damaged."""
    meta = read_meta(folder)
    if runtime == "onnx":
        demand("onnx", "onnxruntime", where="runtime: onnx")
        from cfem.predict.onnx import OnnxPredictor

        return OnnxPredictor(meta, artefact_file(folder, "model.onnx"))
    return build(meta, read_arrays(folder))


def read_meta(folder: Path) -> dict:
    """model.json; InputError where it is missing, damaged or of a kind or format that this version does not know."""
    path = artefact_file(folder, "model.json")
    meta = read_json(path)
    if meta.get("kind") not in KINDS or meta.get("format") != FORMAT:
        raise InputError(
            f"format {meta.get('format')}, kind {meta.get('kind')!r} is unknown to this version",
            where=str(path),
            do="train it anew",
        )
    return meta


def read_arrays(folder: Path, name: str = "weights.npz") -> dict[str, np.ndarray]:
    """The arrays of a .npz file of the folder, no pickles."""
    path = artefact_file(folder, name)
    try:
        with np.load(path, allow_pickle=False) as file:
            return dict(file)
    except (OSError, ValueError, zipfile.BadZipFile) as error:
        raise InputError(f"is damaged: {error}", where=str(path), do="make it anew with --force") from error
