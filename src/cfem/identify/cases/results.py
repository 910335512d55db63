"""Results of a calibration by load cases, as plain data for its files, and whether to trust it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cfem.core.artefact.files import finite
from cfem.core.artefact.judgement import UNCERTAIN, poor
from cfem.identify.cases.fit import CaseFit
from cfem.identify.cases.left_out import LeftOut
from cfem.identify.cases.prediction.table import repeats
from cfem.identify.cases.rig import Rig
from cfem.identify.cases.table import Cases
from cfem.identify.cases.text import shown
from cfem.identify.cases.unknowns import CaseUnknown
from cfem.identify.fit.free_parameter import estimate
from cfem.identify.fit.identifiability import prior_sentences
from cfem.identify.fit.prediction_intervals import t_quantile

_UNLIKE = 2.5  # times: errors of left-out cases beyond what the fit says of itself are told first


@dataclass(frozen=True)
class FittedModel:
    """A fitted model, of several that are compared.

    rig:      with the model's unknowns
    fit:      to all cases
    left_out: each case predicted by the others"""

    rig: Rig
    fit: CaseFit
    left_out: LeftOut

    @property
    def degrees(self) -> float:
        """Degrees of freedom of the inflation."""
        return self.left_out.degrees(self.most)

    @property
    def most(self) -> float:
        """Degrees of freedom of the scatter."""
        return self.fit.count - self.fit.free

    def estimates(self, confidence: float) -> dict[str, dict[str, Any]]:
        """Value, unit and interval of each parameter."""
        deviations = self.left_out.inflation * np.sqrt(np.diag(self.fit.covariance))
        quantile = t_quantile(self.degrees, confidence)
        entries = {}
        for i, unknown in enumerate(self.rig.unknowns):
            result = estimate(unknown, self.fit.z[i], deviations[i], quantile)
            entries[result.name] = {"value": result.value, "unit": result.unit, "interval": list(result.interval)}
        return entries

    def covered(self, confidence: float) -> list[float | None]:
        """Share of coordinates of left-out cases within their intervals, and of markers within their radius."""
        return [finite(share) for share in self.left_out.covered(self.most, confidence)]

    def row(self, find: Sequence[str]) -> dict[str, Any]:
        """Figures by which models are compared; find: its parameters."""
        left_out = self.left_out.distance
        return {
            "find": list(find),
            "in_fit_mm": float(np.nanmean(np.linalg.norm(self.fit.residuals, axis=2))),
            "left_out_mm": float(np.nanmean(left_out)) if np.isfinite(left_out).any() else None,
            "left_out_failed": list(self.left_out.failed),
            "scatter_mm": self.fit.scatter.fixed,
            "scatter_share": self.fit.scatter.share,
            "free": self.fit.free,
            "solves": self.rig.robots.solves,
            **{name: finite(value) for name, value in self.fit.criteria.items()},
        }


def case_results(
    kept: FittedModel,
    models: Mapping[str, Mapping[str, Any]],
    cases: Cases,
    markers: Sequence[str],
    errors: np.ndarray,
    confidence: float,
) -> dict[str, Any]:
    """Parameters with intervals, errors by case and marker, models compared.

    models: a row for each, by name
    errors: (m, k) mm distances in the fit"""
    fitted, left_out, rig = kept.fit, kept.left_out, kept.rig
    estimates, repeated, n_z = kept.estimates(confidence), repeats(cases), len(rig.unknowns)
    prior = [unknown.known for unknown in rig.unknowns]
    return {
        "judgement": _misfit(cases, errors) + _judgement(rig, estimates, left_out),
        "estimates": estimates,
        "scatter_mm": fitted.scatter.fixed,
        "scatter_share": fitted.scatter.share,
        "inflation": left_out.inflation,
        "degrees_of_freedom": kept.degrees,
        "errors_mm": _by_case_and_marker(cases, markers, errors),
        "left_out_mm": _by_case_and_marker(cases, markers, left_out.distance),
        "left_out_within": kept.covered(confidence),
        "repeats_mm": max(repeated.values(), default=None),
        "repeats_by_case_mm": repeated,
        "models": models,
        "best": _best(models),
        "offsets_mm": _by_block(fitted.d, markers, rig, ("offset", "session")),
        "discrepancy_share": None if rig.discrepancy is None else rig.discrepancy.share,
        "discrepancy_mm": _by_block(fitted.d, markers, rig, ("force",)),
        "untold": prior_sentences(rig.unknowns, prior, fitted.z, fitted.covariance[:n_z, :n_z]),
    }


def average_results(
    names: Sequence[str], models: Sequence[FittedModel], weights: np.ndarray, left_out: LeftOut, confidence: float
) -> dict[str, Any]:
    """Weights of the models, errors (mm) of their average at left-out cases, the shares within its intervals, and how
    far the models are from it there (mm, root of the weighted mean square over markers)."""
    most = float(weights @ [model.most for model in models])
    shares = left_out.covered(most, confidence)
    apart = np.stack([model.left_out.residuals - left_out.residuals for model in models])
    squares = np.where(np.isfinite(apart), apart, 0.0) ** 2
    spread = np.einsum("n,nmki->mk", weights, squares)[np.isfinite(left_out.distance)]
    error = left_out.distance[np.isfinite(left_out.distance)]
    return {
        "weights": dict(zip(names, weights.tolist(), strict=True)),
        "left_out_mm": float(error.mean()) if len(error) else None,
        "left_out_within": [finite(share) for share in shares],
        "apart_mm": float(np.sqrt(spread.mean())) if len(spread) else None,
    }


def _best(models: Mapping[str, Mapping[str, Any]]) -> str | None:
    """Name of the model that predicts left-out cases best, None where none can be left out."""
    errors = {name: row["left_out_mm"] for name, row in models.items() if row["left_out_mm"] is not None}
    return min(errors, key=errors.__getitem__, default=None)


def _misfit(cases: Cases, errors: np.ndarray) -> list[dict[str, Any]]:
    """Poor where errors (m, k) mm in the fit are a large share of what the markers move."""
    error, change = float(np.nanmean(errors)), cases.largest_change
    if len(cases) < 2 or error <= UNCERTAIN * change:
        return []
    what = f"the fit leaves {error:.3g} mm, mean over markers, which move by {change:.3g} mm at most"
    return [poor(what + ": look at the forces, their units, and the frame of the markers")]


def _judgement(rig: Rig, estimates: Mapping[str, Any], left_out: LeftOut) -> list[dict[str, Any]]:
    """Poor where nothing tells how well cases are predicted, errors are unexpected, or values implausible."""
    judged = [poor(sentence) for sentence in implausible(rig.unknowns, estimates)]
    if not len(left_out.ratios):
        judged.insert(0, poor("no case can be left out, so nothing tells how well another is predicted"))
    elif left_out.inflation > _UNLIKE:
        what = f"errors of left-out cases are {left_out.inflation:.1f} times those that the fit expects"
        judged.insert(0, poor(what + ": the model lacks something"))
    return judged


def _by_case_and_marker(
    cases: Cases, markers: Sequence[str], distance: np.ndarray
) -> dict[str, dict[str, float | None]]:
    """Distances mm by case and marker, None where not measured."""
    return {
        case: {marker: finite(float(e)) for marker, e in zip(markers, row, strict=True)}
        for case, row in zip(cases.names, distance, strict=True)
    }


def _by_block(d: np.ndarray, markers: Sequence[str], rig: Rig, kinds: Sequence[str]) -> dict[str, Any]:
    """Blocks of d (mm) of these kinds: a vector of each marker."""
    blocks = zip(rig.blocks, np.split(d, len(rig.blocks)) if rig.blocks else (), strict=True)
    return {
        name: {marker: part.tolist() for marker, part in zip(markers, block.reshape(-1, 3), strict=True)}
        for (kind, name), block in blocks
        if kind in kinds
    }


# last word of a key: smallest and largest in its unit, and of what
_RANGES = {
    "density": (0.9e-9, 1.4e-9, "rubbers have"),
    "friction": (0.0, 1.0, "cables in channels of rubber, metal or plastic have"),
    "scale": (0.5, 2.0, "drives of which something is known are within"),
}


def implausible(unknowns: Sequence[CaseUnknown], estimates: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """A sentence for each value whose whole interval lies outside what is known of such."""
    sentences = []
    for unknown in unknowns:
        word = unknown.keys[0].rpartition(".")[2]
        if word not in _RANGES or (word == "scale" and not unknown.known):
            continue
        low, high, owner = _RANGES[word]
        value, (least, most), unit = (estimates[unknown.name][key] for key in ("value", "interval", "unit"))
        if most < low or least > high:
            number, name = shown(value, unit)
            ends = " to ".join(f"{shown(end, unit)[0]:.4g}" for end in (low, high))
            sentences.append(
                f"{unknown.name} {number:.4g}{' ' + name if name else ''} is implausible ({owner} {ends}): it "
                "stands for something that the model lacks"
            )
    return sentences
