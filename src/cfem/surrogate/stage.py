"""`cfem train`: a dataset to a model folder. Test rows judge, and do nothing else.

weights.npz: arrays of the kind's predictor; model.json: its card; test_vectors.npz: the test inputs delta_a with the W
and delta_free that the model gives there, so that every other form of it can be compared."""

import io
import time
from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.errors import InputError
from cfem.core.files import write_json, write_whole
from cfem.core.spec import load_spec
from cfem.core.stage import Options, Stage, artefact_content, artefact_file, run_stage
from cfem.predict.load import build
from cfem.predict.protocol import Predictor
from cfem.surrogate.spec import MlpSpec, SpectralSpec, TrainSpec

DOMAIN_POINTS = 2000


def run(spec_path: Path, overrides: Iterable[str], out: Path | None, options: Options) -> dict[str, Any]:
    """The model's manifest."""
    spec = load_spec(spec_path, TrainSpec, overrides)
    folder = spec_path.parent / spec.dataset
    stage = Stage(
        name="train",
        version=1,
        spec=spec,
        inputs={"dataset": folder},
        out=out or spec_path.parent / spec.out,
        paths=("dataset", "out"),
    )
    return run_stage(stage, partial(work, spec=spec, dataset_folder=folder), options)


def work(folder: Path, spec: TrainSpec, dataset_folder: Path) -> dict[str, Any]:
    """Fills the model folder; results for the manifest."""
    from cfem.dataset.reader import read_dataset

    training = first_rows(read_dataset(artefact_file(dataset_folder, "train.parquet")), spec.samples)
    test = read_dataset(artefact_file(dataset_folder, "test.parquet"))
    if training.rows != test.rows or not len(test.delta_a):
        raise InputError("its test rows are none, or of another robot", where=str(dataset_folder), do="sample it anew")
    meta, arrays, results = train_and_judge(training, test, spec.model)
    results["learning_curve"] = [
        learning_point(first_rows(training, samples), test, spec.model)
        for samples in spec.learning_curve
        if samples < len(training.delta_a)
    ] + [{key: results[key] for key in ("samples", "seconds_fit", "errors")}]
    data = {"content": artefact_content(dataset_folder), "samples": len(training.delta_a)}
    write_json(folder / "model.json", {**meta, "dataset": data})
    write_arrays(folder / "weights.npz", arrays)
    W, delta_free = build(meta, arrays).evaluate(test.delta_a)
    write_arrays(folder / "test_vectors.npz", {"delta_a": test.delta_a, "W": W, "delta_free": delta_free})
    errors = results["errors"]
    results["headline"] = [
        f"{spec.model.kind}, {results['samples']} samples: loss {errors['loss']:.2e} on {errors['states']} states; "
        f"off by {errors['tip_mm']['max']:.2g} mm and {errors['force_N']['max']:.2g} N at most; "
        f"fitted in {results['seconds_fit']:.3g} s, {results['microseconds_query']:.0f} us a query"
    ]
    return results


def train_and_judge(
    training: Any, test: Any, spec: SpectralSpec | MlpSpec
) -> tuple[dict[str, Any], dict[str, np.ndarray], dict[str, Any]]:
    """model.json, arrays, results (errors on the test rows, history, seconds)."""
    from cfem.surrogate.error_measures import measure
    from cfem.surrogate.model_card import model_card

    begin = time.perf_counter()
    arrays, facts, history = (fit_spectral if isinstance(spec, SpectralSpec) else train_mlp)(training, spec)
    seconds = time.perf_counter() - begin
    meta = model_card(spec.kind, training, **facts)
    predictor = build(meta, arrays)
    errors = measure(test, *predictor.evaluate(test.delta_a))
    results = {
        "kind": spec.kind,
        "samples": len(training.delta_a),
        "seconds_fit": seconds,
        "microseconds_query": query_microseconds(predictor, test.delta_a),
        "errors": errors,
        **definiteness(predictor, training.delta_a),
        **facts,
        "history": history,
    }
    return {**meta, "errors": errors, "history": history}, arrays, results


def fit_spectral(training: Any, spec: SpectralSpec) -> tuple[dict, dict, list]:
    from cfem.surrogate.spectral import fit

    found = fit(training, spec.max_degree, spec.folds)
    return found.arrays, {"degrees": found.degrees}, found.held_out


def train_mlp(training: Any, spec: MlpSpec) -> tuple[dict, dict, list]:
    from cfem.surrogate.mlp import train

    found = train(training, spec)
    facts = {"activation": spec.activation, "best_epoch": found.best_epoch}
    return found.model.arrays(), facts, found.history


def learning_point(training: Any, test: Any, spec: SpectralSpec | MlpSpec) -> dict[str, Any]:
    _, _, results = train_and_judge(training, test, spec)
    return {key: results[key] for key in ("samples", "seconds_fit", "errors")}


def definiteness(predictor: Predictor, delta_a: np.ndarray) -> dict[str, Any]:
    """Whether W_aa, and for the energy model hess Psi and C_ee, are positive definite between the training states."""
    from cfem.predict.spectral import SpectralPredictor
    from cfem.surrogate.model_card import random_states, share_positive_definite

    points = random_states(delta_a, DOMAIN_POINTS)
    if isinstance(predictor, SpectralPredictor):
        parts = predictor.parts(points)
        checked = {name: parts[name] for name in ("hessian", "locked_compliance")}
    else:
        checked = {"W": predictor.evaluate(points)[0]}
    return {"positive_definite": {name: share_positive_definite(matrices) for name, matrices in checked.items()}}


def query_microseconds(predictor: Predictor, delta_a: np.ndarray, repeats: int = 500) -> float:
    """Median time of `at_displacement`, one state after the other."""
    times = []
    for i in range(repeats):
        begin = time.perf_counter()
        predictor.at_displacement(delta_a[i % len(delta_a)])
        times.append(time.perf_counter() - begin)
    return 1e6 * float(np.median(times))


def first_rows(dataset: Any, samples: int | None) -> Any:
    """The first `samples` converged rows of a cfem.dataset.reader.Dataset, all of them where None."""
    available = len(dataset.delta_a)
    if (samples or 4) > available:
        raise InputError(
            f"holds {available} converged training rows, {samples or 4} are asked for", do="sample more rows"
        )
    per_row = ("id", "u", "delta_a", "delta_e", "lambda_a", "W", "delta_free", "energy", "slack")
    cost = {name: values[:samples] for name, values in dataset.cost.items()}
    return replace(dataset, **{name: getattr(dataset, name)[:samples] for name in per_row}, cost=cost)


def write_arrays(path: Path, arrays: dict[str, np.ndarray]) -> None:
    """A .npz file, whole or absent; equal arrays, equal bytes (np.savez stamps no time)."""
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    write_whole(path, buffer.getvalue())
