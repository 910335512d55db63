"""Averages of calibrated models, so that nobody has to choose one by a few cases.

Weights are those of stacking (Yao, Vehtari, Simpson, Gelman, Bayesian Analysis 13, 2018): of all mixtures of the
models' predictions, the one under which the left-out measurements are most likely. Coordinates of a case share its one
vote, as their errors are alike, and a third of a case that all models explain alike keeps few cases from deciding all.

The average has the covariance of the models' means beside their own: what choosing one of them would cost. Each
left-out case is averaged with the weights that the others give, so that its error holds the cost of finding weights."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cfem.core.artefact.files import write_json
from cfem.core.errors import InputError
from cfem.identify.cases.left_out import LeftOut
from cfem.identify.cases.prediction.predict import Prediction
from cfem.identify.fit.prediction_intervals import half_and_radius

FILE = "average.json"
_TURNS, _SETTLED = 2000, 1e-6
_ALIKE = 0.3  # cases that all models explain alike: docs/measured.md has what it does to intervals


@dataclass(frozen=True)
class Average:
    """An average of models.

    weights:   (n,), of sum 1
    inflation: of the sd that the average states of itself
    degrees:   of Student's t"""

    weights: np.ndarray
    inflation: float
    degrees: float


def average_of(models: Sequence[LeftOut], most: Sequence[float]) -> tuple[Average, LeftOut]:
    """The average of models by their left-out cases, and its own errors at cases that are left out of models and
    weights; most: degrees of freedom of each one's scatter."""
    density = np.stack([model.log_density(freedom) for model, freedom in zip(models, most, strict=True)])
    weights = stacking_weights(density)
    residuals, covariance = (np.full_like(part, np.nan) for part in (models[0].residuals, models[0].covariance))
    for i in range(len(residuals)):
        able = np.flatnonzero([np.isfinite(model.residuals[i]).any() for model in models])
        if not len(able):
            continue
        share = stacking_weights(np.delete(density, i, axis=1))[able]
        C = np.stack([models[j].covariance[i] for j in able])
        residuals[i], covariance[i] = _mixed(share / share.sum(), np.stack([models[j].residuals[i] for j in able]), C)
    failed = tuple(name for name in models[0].failed if all(name in model.failed for model in models))
    left_out = LeftOut(residuals, covariance, failed)
    return Average(weights, left_out.inflation, left_out.degrees(float(weights @ np.asarray(most)))), left_out


def write_average(path: Path, average: Average, models: Sequence[tuple[str, Sequence[str], str]]) -> None:
    """Writes what `read_average` reads; models: name, parameters and file of each."""
    names = ("name", "find", "file")
    rows = [dict(zip(names, model, strict=True)) for model in models]
    data = {"models": rows, "weights": average.weights, "inflation": average.inflation, "degrees": average.degrees}
    write_json(path, data)


def read_average(path: Path) -> tuple[Average, list[tuple[list[str], str]]]:
    """The average in a file, and parameters and file of each model. InputError where it cannot be read."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        models = [(list(model["find"]), str(model["file"])) for model in data["models"]]
        average = Average(np.array(data["weights"], float), float(data["inflation"]), float(data["degrees"]))
    except (OSError, ValueError, KeyError, TypeError) as error:
        do = "give cases.yaml models to `compare`, and run cfem calibrate-cases again"
        raise InputError(f"is no average of models: {error}", where=str(path), do=do) from None
    return average, models


def stacking_weights(log_density: np.ndarray) -> np.ndarray:
    """Weights (n,) of models from the logarithms of their densities at left-out coordinates (n, m, ...), nan where not
    measured or not predicted. Equal where nothing was."""
    n, m = log_density.shape[:2]
    logs = log_density.reshape(n, m, -1)
    known = np.isfinite(logs).any(axis=0)
    logs = np.where(np.isfinite(logs), logs, -np.inf)
    top = np.where(known, logs.max(axis=0, initial=-np.inf), 0.0)
    density = np.where(known, np.exp(logs - top), 0.0)
    counts = known.sum(axis=1)
    w = np.full(n, 1 / n)
    for _ in range(_TURNS):
        mixed = np.einsum("n,nmi->mi", w, density)
        believed = w[:, None, None] * density / np.where(mixed > 0, mixed, 1.0)
        votes = believed.sum(axis=2) / np.maximum(counts, 1)
        before, w = w, (votes.sum(axis=1) + _ALIKE / n) / ((counts > 0).sum() + _ALIKE)
        if np.abs(w - before).max() < _SETTLED:
            break
    return w / w.sum()


def averaged(predictions: Sequence[Prediction], average: Average, confidence: float) -> Prediction:
    """The average of the models' predictions of the same cases; a case that one of them fails to predict is averaged
    over the others."""
    y, error = (np.full_like(predictions[0].y, np.nan) for _ in range(2))
    covariance = np.full((*y.shape, 3), np.nan)
    failed = {}
    for i in range(len(y)):
        able = [j for j, prediction in enumerate(predictions) if i not in prediction.failed]
        if not able:
            failed[i] = predictions[0].failed[i]
            continue
        share = average.weights[able] / average.weights[able].sum()
        C = np.stack([predictions[j].covariance[i] for j in able])
        y[i], covariance[i] = _mixed(share, np.stack([predictions[j].y[i] for j in able]), C)
        error[i] = y[i] - (predictions[able[0]].y[i] - predictions[able[0]].error[i])
    half, radius = half_and_radius(covariance, average.inflation, average.degrees, confidence)
    best = predictions[int(np.argmax(average.weights))]
    return Prediction(y, half, radius, error, best.poses, failed, covariance)


def _mixed(w: np.ndarray, y: np.ndarray, C: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean (k, 3) and covariance (k, 3, 3) of a mixture with weights (n,) of means (n, k, 3) and covariances
    (n, k, 3, 3)."""
    mean = np.einsum("n,nki->ki", w, y)
    apart = y - mean
    return mean, np.einsum("n,nkij->kij", w, C + apart[..., :, None] * apart[..., None, :])
