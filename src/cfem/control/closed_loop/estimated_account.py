"""Estimates of a run against the truth: columns of `loop.parquet`, figures of the results, a sentence."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from cfem.control.closed_loop.estimated import EstimatingController
from cfem.plant.protocol import Measurement
from cfem.predict.estimation.answer import innovation_ratio
from cfem.predict.estimation.estimate import Estimator
from cfem.predict.protocol import Predictor

COVERED = 1.959964  # standard deviations of a 95 % interval
POINTS = 500  # of the surface, where its error is looked at


def judged(model: Predictor) -> np.ndarray:
    """Numbers (k,) of the skin's nodes where the true surface is compared."""
    return np.linspace(0, len(model.skin.rest) - 1, min(POINTS, len(model.skin.rest))).astype(int)


class EstimateAccount:
    """Comparison of estimates with the truth, for the rows of the table. push (n_e,) N: on the effectors from tick
    `since` on."""

    def __init__(self, estimator: Estimator, push: np.ndarray | None, since: int):
        self._estimator, self._push, self._since = estimator, push, since
        self.unknowns, self._points = estimator.unknowns, judged(estimator.model)
        self._actual: dict[int, Measurement] = {}
        self._of = 0

    def row(self, controller: EstimatingController, tick: int, actual: Measurement) -> dict[str, Any]:
        """Columns of a tick, whose estimate may be of an earlier sample; nan where there is no new one."""
        self._actual[tick] = actual
        columns, estimate = self._no_estimate(), controller.estimate
        if estimate is None or controller.sample_tick == self._of:
            return columns
        self._of = controller.sample_tick
        truth, n_a = self._actual.get(self._of), self._estimator.model.rows.n_a
        self._actual = {number: actual for number, actual in self._actual.items() if number >= self._of}
        columns |= {
            "estimate_of": self._of,
            "estimate_status": estimate.status.value,
            "estimated_e": self._estimator.model.rest_e + estimate.delta_e,
            "estimated_a": estimate.delta_a,
            "estimated_a_sd": estimate.deviation[:n_a],
            "loads": estimate.loads,
            "loads_sd": estimate.deviation[n_a:],
            "true_loads": self._true_loads(self._of),
            "unseen": " ".join(estimate.unseen),
            "left_out": len(estimate.outliers),
            "innovation": estimate.innovation[0],
            "innovation_numbers": estimate.innovation[1],
        }
        if truth is None or truth.status != "converged":
            return columns
        if truth.delta_a is not None:
            columns["true_a"] = truth.delta_a
        if truth.surface is not None and estimate.converged:
            estimated = self._estimator.model.skin.surface(estimate.rows)[self._points]
            square = ((estimated - truth.surface) ** 2).sum(axis=1)
            columns |= {"shape_rms": float(np.sqrt(square.mean())), "shape_max": float(np.sqrt(square.max()))}
        return columns

    def _no_estimate(self) -> dict[str, Any]:
        """Columns of a tick without a new estimate."""
        rows, n_w = self._estimator.model.rows, len(self._estimator.loaded)
        columns: dict[str, Any] = {"estimate_of": 0, "estimate_status": "", "estimated_e": np.full(rows.n_e, np.nan)}
        columns |= {name: np.full(rows.n_a, np.nan) for name in ("estimated_a", "estimated_a_sd", "true_a")}
        columns |= {name: np.full(n_w, np.nan) for name in ("loads", "loads_sd", "true_loads")}
        columns |= {"shape_rms": np.nan, "shape_max": np.nan, "unseen": "", "left_out": 0}
        return columns | {"innovation": np.nan, "innovation_numbers": 0}

    def _true_loads(self, tick: int) -> np.ndarray:
        """True loads (n_w,) N on the loaded rows; nan for rows of the skin, to which a push on an effector is not known
        to be."""
        effectors = self._estimator.model.rows.effectors
        push = np.zeros(len(effectors)) if self._push is None or tick < self._since else self._push
        return np.array(
            [push[effectors.index(name)] if name in effectors else np.nan for name in self._estimator.loaded]
        )


def estimate_results(rows: list[Mapping[str, Any]], unknowns: tuple[str, ...]) -> dict[str, Any]:
    """Errors and intervals of one controller's estimates on one trajectory, against the truth; rows: those of all
    seeds."""
    new = [row for row in rows if row["estimate_of"]]
    good = [row for row in new if row["estimate_status"] == "converged"]
    results: dict[str, Any] = {"samples": len(new), "estimated": len(good)}
    shape = np.array([row["shape_rms"] for row in good], dtype=float)
    if np.isfinite(shape).any():
        worst = np.nanmax([row["shape_max"] for row in good])
        results["shape"] = {"median": float(np.nanmedian(shape)), "max": float(np.nanmax(shape)), "point": float(worst)}
    numbers, inside = {}, []
    for name, values in zip(unknowns, _unknowns(good), strict=True):
        errors, sd = values
        known = np.isfinite(errors)
        if known.any():
            held = np.abs(errors[known]) < COVERED * sd[known]
            seen = np.array([name not in row["unseen"].split() for row in good])[known]
            rms = float(np.sqrt(np.mean(errors[known] ** 2)))
            numbers[name] = {"rms": rms, "sd": float(np.median(sd[known])), "covered": float(held.mean())}
            numbers[name] |= {"numbers": int(known.sum()), "observed": int(seen.sum())}
            inside.append((held, seen))
    if inside:
        held, seen = (np.concatenate(parts) for parts in zip(*inside, strict=True))
        results["covered"], results["observed"] = float(held.mean()), float(seen.mean())
        results["covered_observed"] = float(held[seen].mean()) if seen.any() else None
    results["innovation"] = innovation_ratio([(row["innovation"], row["innovation_numbers"]) for row in good])
    return results | {"unknowns": numbers, "left_out": int(sum(row["left_out"] for row in good))}


def _unknowns(good: list[Mapping[str, Any]]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Errors and standard deviations of each unknown, actuators first."""
    columns = []
    for name, true in (("estimated_a", "true_a"), ("loads", "true_loads")):
        values, truth, sd = (np.array([row[key] for row in good], dtype=float) for key in (name, true, f"{name}_sd"))
        columns += [(values[:, i] - truth[:, i], sd[:, i]) for i in range(values.shape[1] if len(good) else 0)]
    return columns


def estimate_sentence(results: Mapping[str, Any]) -> str:
    """Line of the headline about the estimates."""
    parts = [f"{results['estimated']} of {results['samples']} samples estimated"]
    if "shape" in results:
        parts.append(f"shape to {results['shape']['median']:.2g} mm rms, {results['shape']['max']:.2g} at most")
    if "covered" in results:
        what = f"95 % intervals hold in {100 * results['covered']:.1f} %"
        if results["covered_observed"] is not None:
            what += (
                f", {100 * results['covered_observed']:.1f} % of the {100 * results['observed']:.0f} % that is observed"
            )
        parts.append(what)
    if results.get("innovation"):
        parts.append(f"innovations {results['innovation']:.2f} of what is stated")
    return "estimate: " + ", ".join(parts)
