"""Models of the synthetic robot as folders of C, and the tools to compile them."""

import shutil
from functools import cache
from itertools import pairwise, product
from pathlib import Path

import numpy as np
import pytest
from support.serial_rows import WRENCH, chain
from surrogate.synthetic import dataset

from cfem.export.compiled.build import compiler
from cfem.export.firmware.folder import write_c
from cfem.export.spec import CSpec
from cfem.predict.rows.serial import joined
from cfem.surrogate.model_card import model_card
from cfem.surrogate.series.spectral import Series, fit, series

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


@cache
def serial(modules: int = 2) -> tuple[dict, dict]:
    """Modules in a row, each a polynomial of three chambers that bends, twists and lengthens: strictly convex on
    [0, 20]^3, turns of up to a radian."""
    rng, n = np.random.default_rng(5), 3
    indices = np.array([one for one in product(range(4), repeat=n) if sum(one) <= 3])
    degree, falls = indices.sum(axis=1), 4.0 ** -indices.sum(axis=1)
    psi = np.where((degree == 2) & (indices.max(axis=1) == 2), 900.0, 0.0) + 80 * falls * rng.normal(size=len(indices))
    end = falls[:, None] ** 1.5 * rng.normal(size=(len(indices), 6)) * [20.0, 20.0, 20.0, 1.0, 1.0, 1.0]
    quantities = {"potential": psi[:, None], "effector": end, "effector_compliance": np.zeros((len(indices), 21))}
    chosen = {name: Series(indices, coefficients) for name, coefficients in quantities.items()}
    to_box, offset = np.eye(n) / 10, -np.ones(n)
    found = series(chosen, to_box, n)
    indices, coefficients = found["indices"], found["series"]
    arrays = {"to_box": to_box, "offset": offset, "indices": indices, "series": coefficients}
    training = dataset(60, 1, n * modules, unilateral=False)
    names = {"effectors": [f"end.{axis}" for axis in ("x", "y", "z", "rx", "ry", "rz")]}
    module = model_card("spectral", dataset(60, 1, n, unilateral=False))
    module |= {"rows": {**names, "actuators": module["rows"]["actuators"]}, "rest_e": [55.0, 0, 0, 0, 0, 0]}
    module |= {"row_units": [("mm", "N")] * 3 + [("rad", "N mm")] * 3 + [("mm", "N")] * n}
    row = [{"model": 0, "softer": softer} for softer in [1.0, 1.7, 0.6][:modules]]
    meta = model_card("serial", training, modules=[module], row=row)
    return meta | {"rest_e": [55.0 * modules, 0.0, 0.0]}, joined([arrays])


@cache
def row() -> tuple[dict, dict]:
    """Three modules of two models under a load."""
    made = chain(WRENCH)
    return made.meta, made.arrays


def states(form: str, n_a: int, count: int = 120, parameters: bool = False) -> np.ndarray:
    test = dataset(count, 2, n_a, unilateral=n_a == 2, parameters=parameters)
    return test.delta_a if form == "displacement" else test.lambda_a


def export(folder: Path, model: tuple[dict, dict], pressures: np.ndarray | None = None, **spec) -> dict:
    """Writes the folder; its report."""
    meta, arrays = model
    n_a = len(meta["rows"]["actuators"])
    if meta.get("wrench"):
        s = np.random.default_rng(0).uniform(-1.5, 1.5, (100, n_a))
    else:
        s = states(meta["form"], n_a, parameters=bool(meta["parameters"]))
    return write_c(folder, meta, arrays, CSpec(**spec), s, pressures)


def tool(name: str) -> str:
    """Its path; skips the test where it is not installed."""
    found = shutil.which(name)
    if not found:
        pytest.skip(f"{name} is not installed")
    return found
