"""`cfem train`: a dataset to a model folder. Test rows judge, and do nothing else.

weights.npz: arrays of the kind's predictor; skin.npz: those of the skin, motion.npz: of mass and viscosity, where the
samples have them; model.json: its
card; test_vectors.npz: the test inputs s (and p) with the W and delta_free that the model gives there, so that every
other form of it can be compared."""

import shutil
import time
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from cfem.condensed.mesh_error import mesh_error_of
from cfem.condensed.parameters import completed
from cfem.condensed.skin import read_skin
from cfem.core.artefact.content import artefact_content, artefact_file
from cfem.core.artefact.files import file_sha256, write_json, write_npz
from cfem.core.artefact.manifest import read_manifest
from cfem.core.console.progress import doing
from cfem.core.console.shown import counted
from cfem.core.errors import InputError, NumericalError
from cfem.core.optional import demand
from cfem.core.stage import Command
from cfem.dataset.schema import SKIN
from cfem.predict.load import build, skin_of
from cfem.predict.protocol import Predictor
from cfem.predict.series.skin import FILE
from cfem.surrogate.calibration import calibrated
from cfem.surrogate.definiteness import definiteness
from cfem.surrogate.series.observations import inputs
from cfem.surrogate.spec import MlpSpec, ModelSpec, SerialSpec, SpectralSpec, TrainSpec
from cfem.surrogate.verdict import headline, judged

_ROBOT = ("scene", "robot", "rows", "row_units", "units", "rest_e", "reach", "length", "parameters", "patch")
QUERIES = 100_000  # at which W has to be positive definite


def _placed(model: ModelSpec, base: Path) -> ModelSpec:
    """The spec with the paths of the models that this one is made of as they are from here."""
    if isinstance(model, SerialSpec):
        modules = tuple(module.model_copy(update={"model": base / module.model}) for module in model.modules)
        return model.model_copy(update={"modules": modules})
    at_rest = getattr(model, "at_rest", None)
    return model.model_copy(update={"at_rest": base / at_rest}) if at_rest else model


def _models(model: ModelSpec) -> dict[str, Path]:
    """Folders of the models that this one is made of, by their place in the spec."""
    if isinstance(model, SerialSpec):
        return {f"modules.{number}": module.model for number, module in enumerate(model.modules)}
    at_rest = getattr(model, "at_rest", None)
    return {"at_rest": at_rest} if at_rest else {}


def work(folder: Path, spec: TrainSpec, dataset_folder: Path) -> dict[str, Any]:
    """Fills the model folder; results for the manifest."""
    if isinstance(spec.model, MlpSpec):
        demand("torch", where="kind: mlp")
    training, test = _read_rows(spec, dataset_folder)
    checkpoints = folder / "checkpoints"  # from which a killed training goes on
    doing(f"fitting the model to {counted(len(training), 'sample')}")
    meta, arrays, results = train_and_judge(training, test, spec.model, checkpoints)
    doing("checking the model")
    predictor = build(meta, arrays)
    results["positive_definite"] = definite = definiteness(predictor, training, QUERIES)
    results["model_error"] = meta["model_error"] = calibrated(predictor, test)
    results["learning_curve"] = [
        point(train_and_judge(first_rows(training, samples), test, spec.model, checkpoints)[2])
        for samples in spec.learning_curve
        if samples < len(training)
    ] + [point(results)]
    data = {"content": artefact_content(dataset_folder), "samples": len(training)}
    if moves(training, spec.model):
        doing("learning how it moves")
        frequencies = read_manifest(dataset_folder).get("results", {}).get("frequencies")
        results["motion"] = meta["motion"] = add_motion(folder, training, predictor, test, frequencies)
    mesh_error = read_manifest(dataset_folder).get("results", {}).get("mesh_error")
    if mesh_error_of(mesh_error) is not None and not isinstance(spec.model, SerialSpec):  # of a module, not of a row
        results["mesh_error"] = meta["mesh_error"] = mesh_error
    write_json(folder / "model.json", {**meta, "dataset": data, "positive_definite": definite})
    write_npz(folder / "weights.npz", arrays)
    s, p = model_inputs(predictor, test)
    W, delta_free = predictor.evaluate(s, p)
    write_npz(folder / "test_vectors.npz", {"s": s, "p": p, "W": W, "delta_free": delta_free})
    if spec.skin and isinstance(spec.model, SerialSpec):
        from cfem.surrogate.rows.serial_skin import add_serial_skin

        skin = add_serial_skin(folder, predictor, spec.model, test, dataset_folder)
        results |= {} if skin is None else {"skin": skin}
    elif spec.skin and training.with_skin is not None:
        results["skin"] = add_skin(folder, predictor, arrays, training, test, dataset_folder)
    results["judgement"] = judged(results)
    results["headline"] = headline(results, training.meta["units"])
    shutil.rmtree(checkpoints, ignore_errors=True)
    return results


def _read_rows(spec: TrainSpec, dataset_folder: Path) -> tuple[Any, Any]:
    """Training and test rows. InputError where they are not of one robot, or the model cannot learn from them."""
    from cfem.dataset.reader import read_dataset

    where = str(dataset_folder)
    training = first_rows(read_dataset(artefact_file(dataset_folder, "train.parquet")), spec.samples, dataset_folder)
    test = read_dataset(artefact_file(dataset_folder, "test.parquet"))
    if training.rows != test.rows:
        what = f"its training robot {training.rows.difference(test.rows, 'that of the test rows')}"
        raise InputError(what, where=where, do="sample it again")
    if not len(test):
        raise InputError("has no converged test rows", where=where, do="sample it with more test rows")
    differs = next((key for key in _ROBOT if training.meta.get(key) != test.meta.get(key)), None)
    if differs:
        what = f"its training and test rows are of different robots: their '{differs}' differs"
        raise InputError(what, where=where, do="sample it again")
    if training.meta.get("plan", {}).get("space") == "rest" and not isinstance(spec.model, MlpSpec):
        what = f"its rows are all at rest, and kind {spec.model.kind} cannot learn an energy from them"
        raise InputError(what, where=where, do="train kind: mlp, or use rows of another space")
    return training, test


def moves(training: Any, model: ModelSpec) -> bool:
    """True where the samples have mass, and the model is of a kind that can move."""
    return training.moving is not None and isinstance(model, SpectralSpec) and model.form == "displacement"


def add_motion(
    folder: Path, training: Any, predictor: Predictor, test: Any, frequencies: dict[str, Any] | None
) -> dict[str, Any]:
    """Writes motion.npz; facts of the fit, with the error of its frequencies where those of the test states are
    known."""
    from cfem.motion.model import MotionModel
    from cfem.surrogate.motion import fit_motion
    from cfem.surrogate.motion_error import calibrated_frequencies

    arrays, facts = fit_motion(training)
    write_npz(folder / "motion.npz", arrays)
    if not frequencies:
        return facts
    model = MotionModel(predictor, arrays, facts["viscosity"])
    return {**facts, "frequency_error": calibrated_frequencies(model, test, frequencies)}


def add_skin(
    folder: Path, predictor: Predictor, arrays: dict[str, np.ndarray], training: Any, test: Any, dataset_folder: Path
) -> dict[str, Any]:
    """Fits the skin to the training rows, judges it by the test rows and writes its file; results for the manifest."""
    from cfem.surrogate.skin import fit_skin, judge

    begin, path = time.perf_counter(), artefact_file(dataset_folder, SKIN)
    if not training.with_skin.sha256 == test.with_skin.sha256 == file_sha256(path):
        what = "has rows of another skin than its file holds"
        raise InputError(what, where=str(dataset_folder), do="sample it again with --force")
    doing("fitting the skin")
    fitted = fit_skin(training, read_skin(path), predictor.form, arrays)
    skin = skin_of(predictor, fitted)
    front = judge(skin, test.with_skin, *inputs(test, predictor.form))
    write_npz(folder / FILE, fitted)
    return {
        "modes": len(skin),
        "nodes": len(skin.rest),
        "terms": {"rows": len(fitted["indices"]), "compliance": len(fitted["compliance_indices"])},
        "rms_mm": front.rms[-1],
        "largest_mm": front.largest[-1],
        "largest_percent_of_length": 100 * front.largest[-1] / predictor.length,
        "front": {"rms_mm": front.rms, "largest_mm": front.largest},
        "seconds_fit": time.perf_counter() - begin,
    }


def train_and_judge(
    training: Any, test: Any, spec: ModelSpec, folder: Path | None = None
) -> tuple[dict[str, Any], dict[str, np.ndarray], dict[str, Any]]:
    """Content of model.json, arrays, and results (errors on the test rows, history, seconds). folder: for checkpoints,
    if any."""
    from cfem.surrogate.error_measures import measure, of_loads
    from cfem.surrogate.model_card import model_card
    from cfem.surrogate.rest import with_rest
    from cfem.surrogate.semidefinite import locked_compliance
    from cfem.surrogate.series.observations import inputs

    fit_model = fit_of(spec)  # loaded before its time is taken
    begin = time.perf_counter()
    arrays, facts, history = fit_model(training, spec, folder)
    seconds = time.perf_counter() - begin
    meta = model_card(spec.kind, training, **facts)
    predictor, locked = build(meta, arrays), None
    try:
        if not isinstance(spec, SerialSpec):  # whose modules have been looked at
            locked = locked_compliance(predictor, training)
            meta["semidefinite"] = locked["sizes"]
            predictor = build(meta, arrays)
        errors = measure(test, *predictions(predictor, test))
    except np.linalg.LinAlgError:
        what = f"the model of {len(training)} samples has states without stiffness, where W is singular"
        raise NumericalError(what, do="raise max_degree or max_terms, or sample more rows") from None
    meta |= with_rest(meta, arrays, training, test)
    if spec.kind == "spectral":
        x = np.hstack(inputs(test, predictor.form))
        errors |= of_loads(test, arrays, predictor.box(x), predictor.christoffel(x))
    results = {
        "kind": spec.kind,
        "samples": len(training),
        "seconds_fit": seconds,
        "seconds_sampling": float(training.cost["seconds"].sum()),
        "microseconds_query": query_microseconds(predictor, test),
        "errors": errors,
        "locked_compliance": locked and locked["least"],
        **facts,
        "history": history,
    }
    return {**meta, "errors": errors, "history": history}, arrays, results


Fitted = tuple[dict[str, np.ndarray], dict[str, Any], list[dict[str, Any]]]  # arrays, facts for model.json, history


# Kind of model -> module of `cfem.surrogate`, and its function from (training rows, spec, folder for checkpoints).
FITS: dict[type, tuple[str, str]] = {
    SpectralSpec: ("series.spectral", "fit_spec"),
    MlpSpec: ("networks.mlp", "fit"),
    SerialSpec: ("rows.serial", "compose"),
}


def fit_of(spec: ModelSpec) -> Callable[[Any, ModelSpec, Path | None], Fitted]:
    """Fit of a spec's kind. PyTorch, which some need, takes seconds to load."""
    module, name = FITS[type(spec)]
    return getattr(import_module(f"cfem.surrogate.{module}"), name)


def point(results: dict[str, Any]) -> dict[str, Any]:
    """Point of the learning curve, from the results of one training."""
    kept = ("samples", "seconds_fit", "seconds_sampling", "microseconds_query", "errors")
    return {key: results[key] for key in kept}


def model_inputs(predictor: Predictor, test: Any) -> tuple[np.ndarray, np.ndarray]:
    """Inputs s (m, n_a) by the model's form, p (m, n_p) of the test states."""
    s = test.delta_a if predictor.form == "displacement" else test.lambda_a
    return s, completed(predictor.parameters, test.p)


def predictions(predictor: Predictor, test: Any) -> tuple[np.ndarray, np.ndarray]:
    """W (m, n, n), delta_free (m, n) where the actuators stand as in the test states, whatever the model's form."""
    p = completed(predictor.parameters, test.p)
    if predictor.form == "displacement":
        return predictor.evaluate(test.delta_a, p)
    state = predictor.at_displacement(test.delta_a, p)
    return state.W, state.delta_free


def query_microseconds(predictor: Predictor, test: Any) -> float:
    """Median time of 500 queries, one state after the other."""
    s, p = model_inputs(predictor, test)
    times = []
    for i in range(500):
        state = s[i % len(s)], p[i % len(s)]
        begin = time.perf_counter()
        predictor.at(*state)
        times.append(time.perf_counter() - begin)
    return 1e6 * float(np.median(times))


def first_rows(dataset: Any, samples: int | None, folder: Path | None = None) -> Any:
    """The first `samples` converged rows of a cfem.dataset.reader.Dataset, all of them where None. folder: its own, for
    the message."""
    available = len(dataset)
    if (samples or 4) > available:
        what = f"holds {available} converged training rows, and {samples or 4} are needed"
        raise InputError(what, where=folder and str(folder), do="sample more rows")
    return dataset if samples is None else dataset.take(np.arange(samples))


COMMAND = Command(
    "train",
    11,
    TrainSpec,
    lambda folder, spec, base: work(
        folder, spec.model_copy(update={"model": _placed(spec.model, base)}), base / spec.dataset
    ),
    ("dataset",),
    reads=lambda spec, base: _models(_placed(spec.model, base)),
)
run, stage = COMMAND.run, COMMAND.stage
