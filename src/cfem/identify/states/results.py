"""Estimates of a recording as plain data."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cfem.predict.estimation.answer import Estimate, innovation_ratio
from cfem.predict.estimation.estimate import Estimator
from cfem.predict.estimation.push_bound import Seen, frames_for, push_error

WANTED = 0.1  # share of a push: the error that is asked for
_QUANTILE = 1.959964  # standard deviations of half of a 95 % interval


def estimate_results(
    estimates: Sequence[Estimate],
    estimator: Estimator,
    markers: Sequence[str],
    against_truth: Mapping[str, tuple[np.ndarray, np.ndarray]],
    sensing: Seen | None,
) -> dict[str, Any]:
    """Frames estimated, noise of the markers relative to the stated one, outliers, and what was not observed.

    markers:       names
    against_truth: `errors_and_coverage`
    sensing:       what bounds how well a push can be estimated, None where that is not asked"""
    converged = [estimate for estimate in estimates if estimate.converged]
    noise = [estimate.noise**2 for estimate in converged]
    results = {
        "frames": len(estimates),
        "estimated": len(converged),
        "noise_ratio": float(np.sqrt(np.mean(noise))) if converged else None,
        "innovation": innovation_ratio([estimate.innovation for estimate in converged]),
        "outliers": dict(Counter(markers[number] for estimate in estimates for number in estimate.outliers)),
        "unseen": dict(Counter(name for estimate in estimates for name in estimate.unseen)),
    }
    if sensing is not None and converged:
        results["push"] = _push(converged, estimator, sensing)
    if against_truth:
        results["truth"] = {
            name: {"rms": float(np.sqrt(np.mean(error**2))), "covered": float(covered.mean())}
            for name, (error, covered) in against_truth.items()
        }
    return results


def _push(converged: Sequence[Estimate], estimator: Estimator, sensing: Seen) -> dict[str, Any]:
    """Least error that an estimate of a push can have, at the middle of where the robot stood."""
    delta_a = np.median([estimate.delta_a for estimate in converged], axis=0)
    return {
        "least_error": push_error(estimator, delta_a, sensing, len(converged)),
        "frames_for_10_percent": frames_for(estimator, delta_a, sensing, WANTED),
    }


def errors_and_coverage(
    estimates: Sequence[Estimate], estimator: Estimator, truth: Mapping[str, np.ndarray]
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Errors (f',) in mm or N of each unknown where truth and estimate are known, and whether its 95 % intervals (f',)
    hold the truth."""
    names = list(estimator.unknowns)
    values = np.array([np.concatenate([estimate.delta_a, estimate.loads]) for estimate in estimates])
    deviations = np.array([estimate.deviation for estimate in estimates])
    account = {}
    for name, true in truth.items():
        place = names.index(name)
        error = values[:, place] - true
        known = np.isfinite(error)
        account[name] = error[known], np.abs(error[known]) < _QUANTILE * deviations[known, place]
    return account
