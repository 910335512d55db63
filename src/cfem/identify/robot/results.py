"""Results of a calibration, as plain data for its files."""

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from cfem.condensed.packing import pack_upper
from cfem.condensed.parameters import named
from cfem.core.artefact.files import finite
from cfem.dataset.writer import write_columns
from cfem.identify.robot.calibration import Calibration

_UNITS = {"delta_a": "mm", "lambda_a": "N", "delta_e": "mm", "x_e": "mm", "measured_x_e": "mm"}
_UNITS |= {"measured_delta_e": "mm", "delta_free": "mm", "W": "mm/N"}


def calibration_results(calibration: Calibration, truth: Mapping[str, float], confidence: float) -> dict[str, Any]:
    """Estimates, intervals, identifiability and the account of every start; truth: of parameters, where it is known."""
    known, noise = calibration.uncertainty, calibration.noise
    singular_values = np.zeros(0) if known is None else known.information.singular_values
    return {
        "estimates": _estimates(calibration, truth),
        "p": named(calibration.problem.family.parameters, calibration.p),
        "unseen": list(calibration.unseen),
        "identifiability": {
            "singular_values": singular_values,
            "rank": 0 if known is None else known.information.rank,
            "sentences": [*calibration.lost, *calibration.sentences],
            "known": [asdict(combination) for combination in calibration.combinations],
        },
        "correlation": None if known is None else known.correlation,
        "residual_rms": _residual_rms(calibration),
        "noise": None if noise is None else {"effectors": noise.effectors, "actuators": noise.dual},
        "chance": None if known is None else known.chance,
        "degrees_of_freedom": None if known is None else known.degrees,
        "confidence": confidence,
        "starts": _starts(calibration),
        "evaluations": calibration.evaluations,
        "search_seconds": calibration.seconds,
        "profile_seconds": calibration.profile_seconds,
    }


def write_states(path: Path, calibration: Calibration) -> None:
    """Writes a row a state: what drove it, where it went, what was measured."""
    measured, states = calibration.problem.measured, calibration.states
    columns = {
        "delta_a": states.delta_a,
        "lambda_a": states.lam,
        "delta_e": states.delta_e,
        "x_e": states.x_e,
        "measured_x_e": measured.x_e,
        "measured_delta_e": measured.delta_e,
        "measured_dual": measured.dual,
        "delta_free": states.delta_free,
        "W": pack_upper(states.W),
    }
    meta = {
        "rows": list(states.rows.names),
        "driven": measured.kind,
        "p": named(calibration.problem.family.parameters, calibration.p),
        "units": _UNITS | {"measured_dual": "N" if measured.kind == "displacement" else "mm"},
    }
    write_columns(path, columns, meta)


def _estimates(calibration: Calibration, truth: Mapping[str, float]) -> dict[str, dict[str, Any]]:
    """Value, intervals and, where the truth is known, error of each parameter."""
    entries, has_deviations = {}, calibration.uncertainty is not None and calibration.uncertainty.covariance is not None
    for estimate in calibration.estimates:
        entry = {
            "determined": estimate.deviation is not None or not has_deviations,
            "value": estimate.value,
            "unit": estimate.unit,
            "interval": list(estimate.interval),
            "profile": None if estimate.profile is None else list(estimate.profile),
            "at_end_of_range": estimate.at_end,
        }
        if estimate.name in truth:
            entry |= {"truth": truth[estimate.name], "error": estimate.value - truth[estimate.name]}
        entries[estimate.name] = entry
    return entries


def _residual_rms(calibration: Calibration) -> dict[str, float]:
    """Root mean square of the residuals of each name, mm or N."""
    problem, residuals = calibration.problem, calibration.residuals
    return {name: float(np.sqrt((residuals[problem.numbers_of(name)] ** 2).mean())) for name in problem.names}


def _starts(calibration: Calibration) -> list[dict[str, Any]]:
    """The account of each start."""
    problem = calibration.problem
    best = min((fit.cost for fit in calibration.fits if fit.failure is None), default=None)

    def free_values(z: np.ndarray) -> dict[str, float]:
        values = problem.p(z)[list(problem.free)]
        return dict(zip([parameter.name for parameter in problem.parameters], values, strict=True))

    return [
        {
            "start": free_values(fit.start),
            "found": free_values(fit.u),
            "cost": finite(fit.cost),
            "evaluations": len(fit.costs),
            "seconds": fit.seconds,
            "failure": fit.failure,
            "best": fit.failure is None and fit.cost <= best * (1 + 1e-6) + 1e-18,
        }
        for fit in calibration.fits
    ]
