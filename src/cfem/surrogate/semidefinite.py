"""W of an energy model stays semidefinite where the actuators, locked, leave the effectors no motion in some direction:
there the locked compliance C is singular, and what is learned of it has errors to both sides of zero.

C gains a constant on its diagonal, twice what it lacks at the worst of many states between the training ones. The
constant terms of C hold it, so that no runtime needs to know of it."""

from typing import Any

import numpy as np

from cfem.predict.energy import layout, unpacking
from cfem.predict.protocol import Predictor
from cfem.surrogate.definiteness import between

STATES, SEED = 20_000, 1
SMALLEST = 1e-12  # eigenvalue that C, relative to the diagonal of W, has at least: rounding would hide a smaller one
LARGEST = 1e-5  # of the constant, likewise: a model that lacks more is not near an answer, and is judged as it is


def lifted(predictor: Predictor, arrays: dict[str, np.ndarray], dataset: Any) -> tuple[dict[str, np.ndarray], float]:
    """The arrays of a spectral model or energy net with that constant, and the constant relative to the mean diagonal
    of W; as they are, and 0, where none is needed, or more than the largest."""
    e, a = predictor.rows.e, predictor.rows.a
    W, _ = predictor.evaluate(*between(predictor, dataset, STATES, SEED))
    mean = np.abs(np.einsum("mii->mi", W[:, e, e])).mean(axis=0)
    locked = W[:, e, e] - W[:, e, a] @ np.linalg.solve(W[:, a, a], W[:, a, e])
    least = float(np.linalg.eigvalsh(locked / np.sqrt(np.outer(mean, mean)))[:, 0].min())
    constant = SMALLEST + 2 * max(0.0, -least)
    if least >= SMALLEST or not constant <= LARGEST:
        return arrays, 0.0
    C = layout(predictor.rows.n_a, predictor.rows.n_e)["effector_compliance"]
    diagonal = C.start + np.diag(unpacking(predictor.rows.n_e))
    if "series" in arrays:
        series = arrays["series"].copy()
        series[diagonal, (arrays["indices"] == 0).all(axis=1).argmax()] += constant * mean
        return {**arrays, "series": series}, constant
    polynomial = arrays["polynomial"].copy()
    polynomial[0, diagonal] += constant * mean
    return {**arrays, "polynomial": polynomial}, constant
