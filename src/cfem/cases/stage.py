"""`cfem calibrate-cases`: load cases to the parameters of robot and rig, how well each case is predicted by the others,
and which model the measurements support."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cfem.cases.spec import CasesSpec
from cfem.core.files import write_json, write_whole
from cfem.core.judgement import poor
from cfem.core.optional import installed
from cfem.core.shown import duration
from cfem.core.stage import Command
from cfem.robot.spec import scene_meaning

RESULT, TABLE, FIGURE = "calibration.json", "predicted.csv", "shapes.png"
_UNLIKE = 2.5  # times: errors of left-out cases beyond what the fit says of itself are told first


def _work(folder: Path, spec: CasesSpec, base: Path) -> dict[str, Any]:
    """Results: parameters with intervals, errors by case and marker, models compared."""
    import time

    from scipy.stats import t

    from cfem.cases.compare import told
    from cfem.cases.intervals import half_and_radius
    from cfem.cases.load import load_lab
    from cfem.cases.outcome import FILE, estimates, read_calibrated, write_calibrated
    from cfem.cases.predict import predict
    from cfem.cases.prediction_table import repeats, write_predictions

    begin = time.process_time()
    lab = load_lab(spec, base)
    cases = lab.read(base / spec.measurements)
    compared, (rig, found, left) = _compared(lab, cases, spec)
    most = found.count - found.free
    degrees = left.degrees(most)
    write_calibrated(folder / FILE, found, rig, left.inflation, degrees, cases)
    fitted = predict(rig, cases, read_calibrated(folder / FILE), spec.confidence)
    write_predictions(folder / TABLE, cases, lab.markers, fitted, left)
    if spec.figure and installed("matplotlib"):
        from cfem.cases.figure import shapes_figure

        half, _ = half_and_radius(left.covariance, left.inflation, degrees, spec.confidence)
        title = "Each case, as the calibration by the other cases predicts it"
        shapes = left.posed, left.residuals + cases.target, half
        write_whole(folder / FIGURE, shapes_figure(cases, *shapes, lab.mesh, title, lab.down))
    values = estimates(found, rig, float(t.ppf(0.5 + spec.confidence / 2, degrees)), left.inflation)
    repeated = repeats(cases)
    results = {
        "judgement": _judged(rig, values, left),
        "estimates": values,
        "scatter_mm": found.scatter.fixed,
        "scatter_share": found.scatter.share,
        "inflation": left.inflation,
        "degrees_of_freedom": degrees,
        "errors_mm": _errors(cases, lab.markers, fitted.distance),
        "left_out_mm": _errors(cases, lab.markers, left.distance),
        "left_out_within": [share if np.isfinite(share) else None for share in left.covered(most, spec.confidence)],
        "repeats_mm": max(repeated.values()) if repeated else None,
        "repeats_by_case_mm": repeated,
        "models": compared,
        "best": _best(compared),
        "offsets_mm": _offsets(found.d, lab.markers, rig),
        "untold": told(rig, found),
        "cpu_seconds": time.process_time() - begin,
    }
    write_json(folder / RESULT, results)
    means = float(np.nanmean(fitted.distance)), compared["kept"]["left_out_mm"]
    cost = (
        f"{len(cases)} cases, {found.count} numbers, {sum(one['solves'] for one in compared.values())} equilibria, "
        f"{duration(results['cpu_seconds'])} of CPU time"
    )
    return results | {"headline": [*_headline(results, means, spec.confidence), cost]}


def _compared(lab: Any, cases: Any, spec: CasesSpec) -> tuple[dict[str, dict], tuple]:
    """A row for each model, by name; rig, fit and left-out cases of the one that is kept."""
    from cfem.cases.compare import criteria, leave_one_out
    from cfem.cases.fit import fit_cases
    from cfem.cases.scatter import Scatter

    sessions = tuple(dict.fromkeys(cases.sessions))
    compared, kept = {}, ()
    for name, find in ({"kept": lab.find} | spec.compare).items():
        rig = lab.rig(find, sessions)
        found = fit_cases(rig, cases, Scatter(spec.scatter))
        left = leave_one_out(rig, cases, found)
        compared[name] = _row(find, found, left, criteria(found), rig.robots.solves)
        kept = kept or (rig, found, left)
    return compared, kept


def _best(compared: Mapping[str, Mapping[str, Any]]) -> str | None:
    """By left-out cases, None where none can be left out."""
    told = {name: one["left_out_mm"] for name, one in compared.items() if one["left_out_mm"] is not None}
    return min(told, key=told.__getitem__, default=None)


def _judged(rig: Any, values: Mapping[str, Any], left: Any) -> list[dict[str, str]]:
    from cfem.cases.plausible import implausible

    judged = [poor(what) for what in implausible(rig.unknowns, values)]
    if not len(left.ratios):
        judged.insert(0, poor("no case can be left out, so nothing tells how well another is predicted"))
    elif left.inflation > _UNLIKE:
        what = f"errors of left-out cases are {left.inflation:.1f} times those that the fit expects"
        judged.insert(0, poor(what + ": the model lacks something"))
    return judged


def _headline(results: Mapping[str, Any], means: tuple[float, float | None], confidence: float) -> list[str]:
    """means: mm over the markers, in the fit and of cases left out of it, None where none can be."""
    from cfem.cases.outcome import sentence

    lines = [sentence(name, one) for name, one in results["estimates"].items()] + list(results["untold"])
    beside = "" if means[1] is None else f", {means[1]:.3g} mm of cases left out of it"
    lines.append(f"errors, mean over markers: {means[0]:.3g} mm in the fit{beside}")
    inside, near = results["left_out_within"]
    if inside is not None and near is not None:
        lines.append(
            f"of left-out cases {100 * inside:.0f} % of coordinates lie within their {100 * confidence:g} % "
            f"intervals, {100 * near:.0f} % of markers within their radius"
        )
    if len(results["models"]) > 1 and results["best"] is not None:
        lines.append(f"of {len(results['models'])} models '{results['best']}' predicts left-out cases best")
    if results["repeats_mm"] is not None:
        lines.append(f"repeats of a load differ by {results['repeats_mm']:.2g} mm (largest distance of a marker)")
    return lines


def _row(find: Sequence[str], found: Any, left: Any, criterion: dict[str, float], solves: int) -> dict[str, Any]:
    """Of one model."""
    return {
        "find": list(find),
        "in_fit_mm": float(np.nanmean(np.linalg.norm(found.residuals, axis=2))),
        "left_out_mm": float(np.nanmean(left.distance)) if np.isfinite(left.distance).any() else None,
        "left_out_failed": list(left.failed),
        "scatter_mm": found.scatter.fixed,
        "scatter_share": found.scatter.share,
        "free": found.free,
        "solves": solves,
        **{name: value if np.isfinite(value) else None for name, value in criterion.items()},
    }


def _errors(cases: Any, markers: Sequence[str], distance: np.ndarray) -> dict[str, dict[str, float | None]]:
    """mm by case and marker."""
    return {
        case: {marker: float(e) if np.isfinite(e) else None for marker, e in zip(markers, row, strict=True)}
        for case, row in zip(cases.names, distance, strict=True)
    }


def _offsets(d: np.ndarray, markers: Sequence[str], rig: Any) -> dict[str, dict[str, list[float]]]:
    """mm along the axes that turn with the body: of all sessions, and what each adds."""
    names = ["all", *rig.sessions][: rig.blocks]
    return {
        name: {m: part.tolist() for m, part in zip(markers, block.reshape(-1, 3), strict=True)}
        for name, block in zip(names, np.split(d, rig.blocks) if rig.blocks else (), strict=True)
    }


COMMAND = Command(
    "calibrate-cases",
    4,
    CasesSpec,
    _work,
    ("measurements", "mesh"),
    outside=("scene",),
    extra=lambda spec, base: {"scene": scene_meaning(base / spec.scene)},
)
run, stage = COMMAND.run, COMMAND.stage
