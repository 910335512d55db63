"""`cfem predict-cases`: a table of other load cases to predictions with intervals, and to errors where they were
measured."""

from pathlib import Path
from typing import Any

import numpy as np

from cfem.cases.outcome import FILE
from cfem.cases.prediction.spec import PredictSpec
from cfem.cases.spec import CasesSpec
from cfem.core.errors import InputError, NumericalError
from cfem.core.files import write_json, write_whole
from cfem.core.judgement import poor
from cfem.core.optional import installed
from cfem.core.spec import load_spec, meaning
from cfem.core.stage import Command, artefact_file
from cfem.robot.spec import scene_meaning

RESULT, TABLE, FIGURE = "prediction.json", "predicted.csv", "shapes.png"


def _extra(spec: PredictSpec, base: Path) -> dict[str, Any]:
    path = base / spec.cases
    cases = load_spec(path, CasesSpec)
    scene = scene_meaning(path.parent / cases.scene)
    return {"scene": scene, "cases": meaning(cases, ("scene", "mesh", "measurements", "out"))}


def _work(folder: Path, spec: PredictSpec, base: Path) -> dict[str, Any]:
    """Results: errors by case and marker, share within the intervals."""
    from cfem.cases.load import load_lab
    from cfem.cases.outcome import read_calibrated
    from cfem.cases.predict import beyond_calibration, predict
    from cfem.cases.prediction_table import repeats, write_predictions

    path = base / spec.cases
    lab = load_lab(load_spec(path, CasesSpec), path.parent)
    known = read_calibrated(artefact_file(base / spec.calibrated, FILE))
    cases = lab.read(base / spec.table, measured=False)
    rig = lab.rig(lab.find, tuple(dict.fromkeys([*known.sessions, *cases.sessions])))
    strange = [name for name in known.names if name not in {one.name for one in rig.unknowns}]
    if strange:
        what = f"was made with the unknown '{strange[0]}', which {spec.cases} does not find"
        raise InputError(what, where=str(spec.calibrated), do="run cfem calibrate-cases again")
    found = predict(rig, cases, known, spec.confidence, spec.beyond)
    write_predictions(folder / TABLE, cases, lab.markers, found)
    if spec.figure and installed("matplotlib"):
        from cfem.cases.figure import shapes_figure

        posed = tuple(None if i in found.failed else one for i, one in enumerate(found.posed))
        drawn = shapes_figure(cases, posed, found.y, found.half, lab.mesh, "Predicted", lab.down)
        write_whole(folder / FIGURE, drawn)
    measured = np.isfinite(found.distance)
    known_before = sum(bool(mark) and mark in known.given for mark in cases.marks)
    beyond = [cases.names[i] for i in np.flatnonzero(beyond_calibration(cases, known))]
    if len(found.failed) == len(cases):
        raise NumericalError(f"no case has an equilibrium; the first: {next(iter(found.failed.values()))}")
    half = float(np.nanmedian(found.half))
    headline = [f"{len(cases)} cases predicted; half of the median interval is {half:.3g} mm, in {TABLE}"]
    failed = {cases.names[i]: why for i, why in found.failed.items()}
    if failed:
        name, why = next(iter(failed.items()))
        headline.insert(0, f"{len(failed)} of {len(cases)} cases have no equilibrium; the first, {name}: {why}")
    if known_before:
        headline.insert(
            0,
            f"{known_before} of {len(cases)} cases are of the calibration: their errors are not those of predictions",
        )
    results: dict[str, Any] = {"headline": headline, "cases": len(cases), "median_half_mm": half, "failed": failed}
    results["in_fit"] = known_before
    if beyond:
        what = f"{len(beyond)} of {len(cases)} cases are of larger forces than the calibration, the first {beyond[0]}"
        results["judgement"] = [poor(f"{what}: their intervals hold a guess of what the model lacks there")]
    if measured.any():
        coordinates, markers = found.covered()
        by_marker = {name: _mean(found.distance[:, j]) for j, name in enumerate(lab.markers)}
        by_case = {name: _mean(found.distance[i]) for i, name in enumerate(cases.names)}
        mean, worst = float(np.nanmean(found.distance)), float(np.nanmax(found.distance))
        percent = f"{100 * spec.confidence:g} %"
        headline += [
            f"error {mean:.3g} mm, mean over {int(measured.sum())} markers; largest {worst:.3g} mm",
            f"{100 * coordinates:.0f} % of coordinates lie within their {percent} intervals, "
            f"{100 * markers:.0f} % of markers within their {percent} radius",
        ]
        scatter = repeats(cases)
        if scatter:
            headline.append(
                f"repeats of a load differ by {max(scatter.values()):.2g} mm (largest distance of a marker)"
            )
        results |= {
            "mean_mm": mean,
            "largest_mm": worst,
            "by_marker_mm": by_marker,
            "by_case_mm": by_case,
            "coordinates_within": coordinates,
            "markers_within": markers,
            "repeats_mm": max(scatter.values()) if scatter else None,
        }
    write_json(folder / RESULT, {key: value for key, value in results.items() if key != "headline"})
    return results


def _mean(distance: np.ndarray) -> float | None:
    return float(np.nanmean(distance)) if np.isfinite(distance).any() else None


COMMAND = Command("predict-cases", 4, PredictSpec, _work, ("calibrated", "table"), outside=("cases",), extra=_extra)
run, stage = COMMAND.run, COMMAND.stage
