"""Models of the synthetic robot as folders of C, and the tools to compile them."""

import shutil
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from surrogate.synthetic import dataset

from cfem.export.c_export import write_c
from cfem.export.compiled import compiler
from cfem.export.spec import CSpec
from cfem.surrogate.model_card import model_card
from cfem.surrogate.spectral import fit

needs_compiler = pytest.mark.skipif(compiler() is None, reason="there is no C compiler on the PATH")


@cache
def spectral(form: str = "displacement", n_a: int = 2, parameters: bool = False) -> tuple[dict, dict]:
    """model.json and arrays of the energy model."""
    training = dataset(60, 1, n_a, unilateral=n_a == 2, parameters=parameters)
    return model_card("spectral", training, form), fit(training, form, max_degree=9).arrays


@cache
def network(activation: str = "relu", width: int = 24, n_a: int = 2) -> tuple[dict, dict]:
    """A network of the entries with random weights: nothing here depends on what it has learned, only W must be
    positive definite."""
    rng = np.random.default_rng(3)
    training = dataset(60, 1, n_a, unilateral=n_a == 2)
    n = n_a + 3
    k = n * (n + 1) // 2 + n
    sizes = [n_a, width, width, k]
    arrays = {"in_mean": training.delta_a.mean(axis=0), "in_scale": training.delta_a.std(axis=0)}
    W = training.W[:, *np.triu_indices(n)]
    arrays["out_mean"] = np.concatenate([W.mean(axis=0), training.delta_free.mean(axis=0)])
    arrays["out_scale"] = 0.03 * np.abs(arrays["out_mean"]) + 1e-3
    for i, (inputs, outputs) in enumerate(pairwise(sizes)):
        arrays[f"weight_{i}"] = (rng.normal(size=(outputs, inputs)) / np.sqrt(inputs)).astype(np.float32)
        arrays[f"bias_{i}"] = (0.1 * rng.normal(size=outputs)).astype(np.float32)
    return model_card("mlp", training, activation=activation), arrays


def states(form: str, n_a: int, count: int = 120, parameters: bool = False) -> np.ndarray:
    test = dataset(count, 2, n_a, unilateral=n_a == 2, parameters=parameters)
    return test.delta_a if form == "displacement" else test.lambda_a


def export(folder: Path, model: tuple[dict, dict], **spec) -> dict:
    """Writes the folder; its report."""
    meta, arrays = model
    n_a = len(meta["rows"]["actuators"])
    return write_c(folder, meta, arrays, CSpec(**spec), states(meta["form"], n_a, parameters=bool(meta["parameters"])))


def tool(name: str) -> str:
    """Its path; skips the test where it is not installed."""
    found = shutil.which(name)
    if not found:
        pytest.skip(f"{name} is not installed")
    return found
