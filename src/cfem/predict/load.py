"""From a model folder to a predictor."""

from pathlib import Path
from typing import Literal

import numpy as np

from cfem.core.errors import InputError
from cfem.core.files import read_json
from cfem.core.optional import demand
from cfem.core.reading import checked, read_npz
from cfem.core.stage import artefact_file
from cfem.predict import energy_net, mlp, serial, spectral  # noqa: F401  (each joins KINDS)
from cfem.predict.card import ABSENT, FORMAT, ModelCard
from cfem.predict.protocol import Predictor, build

WEIGHTS = "weights.npz"
UNBOUNDED = ("in_scale", mlp.AT_REST + "in_scale")  # infinite for inputs that did not vary
Runtime = Literal["arrays", "onnx"]


def load_model(folder: Path, runtime: Runtime = "arrays") -> Predictor:
    """The model of a folder that `cfem train` or `cfem export` made. InputError where a file is missing or damaged."""
    meta = read_meta(folder)
    if runtime == "onnx":
        demand("onnx", "onnxruntime", where="runtime: onnx")
        from cfem.predict.onnx import OnnxPredictor

        path = artefact_file(folder, "model.onnx")
        predictor = OnnxPredictor(meta, path)
        try:
            demand_finite(predictor)
        except InputError as error:
            raise InputError(error.what, where=str(path), do="export it again") from None
        return predictor
    try:
        predictor = build(meta, read_arrays(folder))
        demand_finite(predictor)
    except InputError as error:
        if error.where:
            raise
        raise InputError(error.what, where=str(folder / WEIGHTS), do="train it again") from None
    return predictor


def demand_finite(predictor: Predictor) -> None:
    """InputError where a model gives no finite numbers at a state that it was trained on."""
    n_a, domain = predictor.rows.n_a, predictor.domain.states[0]
    s = domain[:n_a] if predictor.form == "displacement" else domain[n_a : 2 * n_a]
    with np.errstate(all="ignore"):
        try:
            condensed = predictor.at(s)
            finite = np.isfinite(condensed.W).all() and np.isfinite(condensed.delta).all()
        except np.linalg.LinAlgError:
            finite = False
    if not finite:
        raise InputError("gives numbers that are not finite at a state that it was trained on")


def read_meta(folder: Path) -> dict:
    """model.json; InputError where it is missing, damaged or of a kind or format that this version does not know."""
    path = artefact_file(folder, "model.json")
    meta = {**ABSENT, **read_json(path)}
    if meta.get("format") != FORMAT:
        what = f"has format {str(meta.get('format'))[:50]}; this version of cfem reads format {FORMAT}"
        raise InputError(what, where=str(path), do="train it again")
    checked(ModelCard, meta, str(path), "train it again")
    return meta


def read_arrays(folder: Path, name: str = WEIGHTS) -> dict[str, np.ndarray]:
    """The arrays of a .npz file of the folder, no pickles."""
    return read_npz(artefact_file(folder, name), UNBOUNDED)
