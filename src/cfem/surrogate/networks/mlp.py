"""Trains the paper's network F on the entries of W and delta_free, standardised, by mean squared error.

The inputs are delta_a, or lambda_a in the force form, and the coordinates of the sampled parameters p; or, in place of
p, W0 and delta_free0, the condensed model at rest, which another model makes of p (`at_rest`): the paper's F and G. The
network is the same for any number of actuators. W is symmetric because its upper triangle is what is learned; nothing
makes it positive definite.

Every tenth training row validates: it steers the schedule and picks the epoch. Test rows never come here."""

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from cfem.condensed import entries
from cfem.condensed.parameters import sampled
from cfem.core.errors import InputError
from cfem.core.spec import meaning
from cfem.predict.kinds.mlp import AT_REST, rest_entries
from cfem.predict.load import build, read_model
from cfem.predict.series.domain import MARGIN
from cfem.surrogate.error_measures import CONSTANT, SIZE, sizes
from cfem.surrogate.networks.descent import descend
from cfem.surrogate.series.observations import inputs
from cfem.surrogate.spec import MlpSpec
from cfem.surrogate.torch_model import Mlp

VALIDATION_STRIDE = 10


@dataclass(frozen=True)
class Training:
    """A trained network.

    model: at its best epoch, on the CPU
    validation: its standardised loss on the validation rows
    history: one record a hundredth of the epochs"""

    model: Mlp
    best_epoch: int
    validation: float
    history: list[dict[str, float]]


def fit(
    dataset: Any, spec: MlpSpec, folder: Path | None = None
) -> tuple[dict[str, np.ndarray], dict[str, Any], list[dict[str, float]]]:
    """Arrays of cfem.predict.kinds.mlp, facts for model.json, history.

    dataset: cfem.dataset.reader.Dataset, training rows only. folder: where a killed fit of the same rows by the same
    spec goes on; what is kept there is the caller's to remove."""
    training = train(dataset, spec, None if folder is None else folder / f"mlp-{identity(dataset, spec)}.pt")
    arrays, facts = training.model.arrays(), {name: getattr(spec, name) for name in ("form", "activation")}
    if spec.at_rest is not None:
        facts["at_rest"], rest = rest_model(spec.at_rest, dataset)
        arrays |= {AT_REST + name: values for name, values in rest.items()}
    validated = {"best_epoch": training.best_epoch, "validation_loss": training.validation}
    return arrays, {**facts, **validated, "device": device_of(spec).type}, training.history


def train(dataset: Any, spec: MlpSpec, checkpoint: Path | None = None) -> Training:
    """Trains one network; checkpoint: as in `cfem.surrogate.networks.descent.descend`.

    Raises InputError where no row is left to validate or the device is not there, NumericalError where it diverges."""
    device, m = device_of(spec), len(dataset.delta_a)
    validates = np.arange(m) % VALIDATION_STRIDE == VALIDATION_STRIDE - 1
    if not validates.any():
        raise InputError(
            f"{m} training rows are too few: none would be left to validate the network",
            do=f"use {VALIDATION_STRIDE} or more",
        )
    with torch.random.fork_rng(devices=[device] if device.type == "cuda" else []):
        torch.manual_seed(spec.seed)
        given, size = network_inputs(dataset, spec)
        k = given.shape[1] - dataset.rows.n_a
        model = Mlp(dataset.rows, k, spec.width, spec.depth, spec.activation, spec.dropout)
        rows = standardise(model, given, size, dataset, ~validates)
        fitted, held_out = (tuple(values[chosen].to(device) for values in rows) for chosen in (~validates, validates))
        record = descend(model.net.to(device), fitted, held_out, spec, checkpoint)
    return Training(model.cpu().eval(), record["best_epoch"], record["best"], record["history"])


def device_of(spec: MlpSpec) -> torch.device:
    """Device to train on. InputError where the spec asks for a GPU and there is none."""
    gpu = torch.cuda.is_available()
    if spec.device == "cuda" and not gpu:
        raise InputError("PyTorch finds no GPU on this machine", where="model.device: cuda", do="set it to auto or cpu")
    return torch.device("cuda" if gpu and spec.device != "cpu" else "cpu")


def network_inputs(dataset: Any, spec: MlpSpec) -> tuple[np.ndarray, np.ndarray]:
    """Inputs (m, n_a + k), s and what is beside it, and the scale (n_a + k,) of each."""
    s, q = inputs(dataset, spec.form)
    size = np.maximum(np.abs(s).max(axis=0), SIZE)
    if spec.at_rest is None:
        return np.hstack([s, q]), np.concatenate([size, np.abs(q).max(axis=0)])
    beside = rest_entries(build(*rest_model(spec.at_rest, dataset)), q)
    return np.hstack([s, beside]), np.concatenate([size, sizes(beside, dataset.rows.n)])


def rest_model(folder: Path, dataset: Any) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Content of model.json and arrays of the model at rest. InputError where it is of other robots or does not know
    rest."""
    meta, arrays = read_model(folder)
    meta.pop("history", None)
    model = build(meta, arrays)
    known, asked = (
        [(parameter.key, parameter.coordinate) for parameter in sampled(given.parameters)] for given in (model, dataset)
    )
    if not asked or known != asked or model.rows != dataset.rows:
        raise InputError(
            f"is of parameters {[key for key, _ in known]} and rows {', '.join(model.rows.names)}, the dataset of "
            f"{[key for key, _ in asked]} and {', '.join(dataset.rows.names)}",
            where=str(folder),
            do="train it on rest rows of the same scene and parameters",
        )
    low, high = model.domain.delta_a if model.form == "displacement" else model.domain.lambda_a
    if (np.maximum(low, -high) > MARGIN * np.maximum(high - low, SIZE)).any():
        do = "train kind: mlp on a dataset with space: rest, in the form force if the scene carries loads"
        raise InputError("was trained on no state at rest", where=str(folder), do=do)
    return meta, arrays


def standardise(
    model: Mlp, values: np.ndarray, size: np.ndarray, dataset: Any, fitted: np.ndarray
) -> tuple[Tensor, Tensor]:
    """Sets the model's means and scales from the rows `fitted` (m,) bool of its inputs `values` (m, n_a + k), each as
    large as `size` at most, and its outputs; returns all rows of both standardised, float32."""
    outputs = entries(dataset.W, dataset.delta_free)
    out_mean, out_scale = outputs[fitted].mean(axis=0), outputs[fitted].std(axis=0)
    constant = out_scale <= CONSTANT * sizes(outputs, dataset.rows.n)
    in_mean, in_scale = values[fitted].mean(axis=0), values[fitted].std(axis=0)
    in_scale[in_scale <= CONSTANT * size] = np.inf  # what never varied says nothing
    numbers = {
        "in_mean": in_mean,
        "in_scale": in_scale,
        "out_mean": out_mean,
        "out_scale": np.where(constant, 0.0, out_scale),
    }
    for name, number in numbers.items():
        getattr(model, name).copy_(torch.as_tensor(number))
    targets = (outputs - out_mean) / np.where(constant, np.inf, out_scale)
    return torch.as_tensor((values - in_mean) / in_scale).float(), torch.as_tensor(targets).float()


def identity(dataset: Any, spec: MlpSpec) -> str:
    """Names what a fit is of: its rows and its spec."""
    digest = hashlib.sha256(json.dumps(meaning(spec, {"at_rest"})).encode())
    for values in (*network_inputs(dataset, spec), dataset.W, dataset.delta_free):
        digest.update(np.ascontiguousarray(values).tobytes())
    return digest.hexdigest()[:16]
