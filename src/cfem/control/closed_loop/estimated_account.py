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
    """(k,) numbers of the skin's nodes where the true surface is compared."""
    return np.linspace(0, len(model.skin.rest) - 1, min(POINTS, len(model.skin.rest))).astype(int)


class EstimateAccount:
    """Estimates against the truth, for the rows of the table. push (n_e,) N: on the effectors from tick `since` on."""

    def __init__(self, estimator: Estimator, push: np.ndarray | None, since: int):
        self._estimator, self._push, self._since = estimator, push, since
        self.unknowns, self._points = estimator.unknowns, judged(estimator.model)
        self._actual: dict[int, Measurement] = {}
        self._of = 0

    def row(self, controller: EstimatingController, tick: int, actual: Measurement) -> dict[str, Any]:
        """Columns of a tick, whose estimate may be of an earlier sample; nan where there is no new one."""
        self._actual[tick] = actual
        rows, found = self._estimator.model.rows, controller.found
        if found is None or controller.of == self._of:
            return self._columns("", *(np.full(n, np.nan) for n in (rows.n_e, *[rows.n_a] * 3)), *self._no_loads, None)
        self._of = controller.of
        truth = self._actual.get(controller.of)
        self._actual = {number: one for number, one in self._actual.items() if number >= controller.of}
        nothing = np.full(rows.n_a, np.nan)
        known = truth is not None and truth.status == "converged"
        shape = None
        if known and truth.surface is not None and found.converged:
            here = self._estimator.model.skin.surface(found.rows)[self._points]
            shape = ((here - truth.surface) ** 2).sum(axis=1)
        n_a, deviation = rows.n_a, found.deviation
        return self._columns(
            found.status.value,
            self._estimator.model.rest_e + found.delta_e,
            found.delta_a,
            deviation[:n_a],
            truth.delta_a if known and truth.delta_a is not None else nothing,
            found.loads,
            deviation[n_a:],
            self._true_loads(controller.of),
            shape,
            found,
        )

    @property
    def _no_loads(self) -> list[np.ndarray]:
        return [np.full(len(self._estimator.loaded), np.nan)] * 3

    def _columns(self, status, x_e, delta_a, delta_a_sd, delta_a_true, loads, loads_sd, loads_true, shape, found=None):
        """shape: (k,) mm^2 of each point, None where it is not known."""
        return {
            "estimate_of": self._of if found is not None else 0,
            "estimate_status": status,
            "estimated_e": x_e,
            "estimated_a": delta_a,
            "estimated_a_sd": delta_a_sd,
            "true_a": delta_a_true,
            "loads": loads,
            "loads_sd": loads_sd,
            "true_loads": loads_true,
            "shape_rms": np.nan if shape is None else float(np.sqrt(shape.mean())),
            "shape_max": np.nan if shape is None else float(np.sqrt(shape.max())),
            "unseen": "" if found is None else " ".join(found.unseen),
            "left_out": 0 if found is None else len(found.outliers),
            "innovation": np.nan if found is None else found.innovation[0],
            "innovation_numbers": 0 if found is None else found.innovation[1],
        }

    def _true_loads(self, tick: int) -> np.ndarray:
        """(n_w,) N on the loaded rows; nan for rows of the skin, to which a push on an effector is not known to be."""
        effectors = self._estimator.model.rows.effectors
        push = np.zeros(len(effectors)) if self._push is None or tick < self._since else self._push
        return np.array(
            [push[effectors.index(name)] if name in effectors else np.nan for name in self._estimator.loaded]
        )


def estimate_results(rows: list[Mapping[str, Any]], unknowns: tuple[str, ...]) -> dict[str, Any]:
    """Of one controller on one trajectory, its rows of all seeds: errors and intervals against the truth."""
    new = [one for one in rows if one["estimate_of"]]
    good = [one for one in new if one["estimate_status"] == "converged"]
    found: dict[str, Any] = {"samples": len(new), "estimated": len(good)}
    shape = np.array([one["shape_rms"] for one in good], dtype=float)
    if np.isfinite(shape).any():
        worst = np.nanmax([one["shape_max"] for one in good])
        found["shape"] = {"median": float(np.nanmedian(shape)), "max": float(np.nanmax(shape)), "point": float(worst)}
    numbers, inside = {}, []
    for name, values in zip(unknowns, _unknowns(good), strict=True):
        off, sd = values
        known = np.isfinite(off)
        if known.any():
            held = np.abs(off[known]) < COVERED * sd[known]
            seen = np.array([name not in one["unseen"].split() for one in good])[known]
            rms = float(np.sqrt(np.mean(off[known] ** 2)))
            numbers[name] = {"rms": rms, "sd": float(np.median(sd[known])), "covered": float(held.mean())}
            numbers[name] |= {"numbers": int(known.sum()), "observed": int(seen.sum())}
            inside.append((held, seen))
    if inside:
        held, seen = (np.concatenate(one) for one in zip(*inside, strict=True))
        found["covered"], found["observed"] = float(held.mean()), float(seen.mean())
        found["covered_observed"] = float(held[seen].mean()) if seen.any() else None
    found["innovation"] = innovation_ratio([(one["innovation"], one["innovation_numbers"]) for one in good])
    return found | {"unknowns": numbers, "left_out": int(sum(one["left_out"] for one in good))}


def _unknowns(good: list[Mapping[str, Any]]) -> list[tuple[np.ndarray, np.ndarray]]:
    """(errors, standard deviations) of each unknown, actuators first."""
    columns = []
    for name, true in (("estimated_a", "true_a"), ("loads", "true_loads")):
        values, truth, sd = (np.array([one[key] for one in good], dtype=float) for key in (name, true, f"{name}_sd"))
        columns += [(values[:, i] - truth[:, i], sd[:, i]) for i in range(values.shape[1] if len(good) else 0)]
    return columns


def estimate_sentence(found: Mapping[str, Any]) -> str:
    parts = [f"{found['estimated']} of {found['samples']} samples estimated"]
    if "shape" in found:
        parts.append(f"shape to {found['shape']['median']:.2g} mm rms, {found['shape']['max']:.2g} at most")
    if "covered" in found:
        what = f"95 % intervals hold in {100 * found['covered']:.1f} %"
        if found["covered_observed"] is not None:
            what += f", {100 * found['covered_observed']:.1f} % of the {100 * found['observed']:.0f} % that is observed"
        parts.append(what)
    if found.get("innovation"):
        parts.append(f"innovations {found['innovation']:.2f} of what is stated")
    return "estimate: " + ", ".join(parts)
