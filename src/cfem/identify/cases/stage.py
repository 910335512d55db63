"""`cfem calibrate-cases`: load cases to the parameters of robot and rig, how well each case is predicted by the others,
and which model the measurements support."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.artefact.files import write_json, write_whole
from cfem.core.console.shown import duration
from cfem.core.optional import installed
from cfem.core.stage import Command
from cfem.identify.cases.spec import CasesSpec
from cfem.robot.spec import scene_meaning

RESULT, TABLE, FIGURE = "calibration.json", "predicted.csv", "shapes.png"


def _work(folder: Path, spec: CasesSpec, base: Path) -> dict[str, Any]:
    """Results: parameters with intervals, errors by case and marker, models compared."""
    import time

    from cfem.identify.cases.calibrated_scene import FILE as SCENE
    from cfem.identify.cases.calibrated_scene import calibrated_scene
    from cfem.identify.cases.load import load_lab
    from cfem.identify.cases.outcome import FILE, read_calibrated, write_calibrated
    from cfem.identify.cases.prediction.predict import predict
    from cfem.identify.cases.prediction.table import write_predictions
    from cfem.identify.cases.results import case_results
    from cfem.identify.cases.text import headline

    begin = time.process_time()
    lab = load_lab(spec, base)
    cases = lab.read(base / spec.measurements)
    fitted = {name: _fitted(lab, cases, find, spec) for name, find in ({"kept": lab.find} | spec.compare).items()}
    models = {name: model.row(find) for name, (find, model) in fitted.items()}
    _, kept = fitted["kept"]
    averaged = _average(folder, fitted, cases, spec.confidence)
    rig, left_out = kept.rig, kept.left_out
    write_calibrated(folder / FILE, kept.fit, rig, left_out.inflation, kept.degrees, cases)
    text, left_out_of_scene = calibrated_scene(lab, rig, kept.fit, base / spec.out, base / spec.mesh)
    write_whole(folder / SCENE, text.encode())
    in_fit = predict(rig, cases, read_calibrated(folder / FILE), spec.confidence)
    write_predictions(folder / TABLE, cases, lab.markers, in_fit, left_out)
    if spec.figure and installed("matplotlib"):
        from cfem.identify.cases.figure import shapes_figure
        from cfem.identify.fit.prediction_intervals import half_and_radius

        half, _ = half_and_radius(left_out.covariance, left_out.inflation, kept.degrees, spec.confidence)
        title = "Each case, as the calibration by the other cases predicts it"
        shapes = left_out.poses, left_out.residuals + cases.target, half, spec.confidence
        write_whole(folder / FIGURE, shapes_figure(cases, *shapes, lab.mesh, title, lab.down))
    results = case_results(kept, models, cases, lab.markers, in_fit.distance, spec.confidence)
    results["average"] = averaged
    results["cpu_seconds"] = time.process_time() - begin
    write_json(folder / RESULT, results)
    cost = (
        f"{len(cases)} cases, {kept.fit.count} numbers, {sum(row['solves'] for row in models.values())} equilibria, "
        f"{duration(results['cpu_seconds'])} of CPU time"
    )
    lines = headline(results, float(np.nanmean(in_fit.distance)), spec.confidence)
    made = f"{SCENE} is the calibrated robot, for `scene` of sample.yaml"
    return results | {"headline": [*lines, *left_out_of_scene, made, cost]}


def _average(folder: Path, fitted: Mapping[str, Any], cases: Any, confidence: float) -> dict[str, Any] | None:
    """Writes every model and their average; weights and errors of the average. None of one model alone."""
    from cfem.identify.cases.average import FILE as AVERAGE
    from cfem.identify.cases.average import average_of, write_average
    from cfem.identify.cases.outcome import FILE, write_calibrated
    from cfem.identify.cases.results import average_results

    if len(fitted) == 1:
        return None
    models = [model for _, model in fitted.values()]
    most = [model.most for model in models]
    average, left_out = average_of([model.left_out for model in models], most)
    rows = []
    for number, (name, (find, model)) in enumerate(fitted.items()):
        file = f"{Path(FILE).stem}-{number}.json"
        write_calibrated(folder / file, model.fit, model.rig, model.left_out.inflation, model.degrees, cases)
        rows.append((name, find, file))
    write_average(folder / AVERAGE, average, rows)
    return average_results(list(fitted), models, average.weights, left_out, confidence)


def _fitted(lab: Any, cases: Any, find: list[str], spec: CasesSpec) -> tuple[list[str], Any]:
    """The parameters of a model, and the model fitted to the cases."""
    from cfem.identify.cases.discrepancy import discrepancy_of
    from cfem.identify.cases.fit import fit_with_discrepancy
    from cfem.identify.cases.left_out import leave_one_out
    from cfem.identify.cases.results import FittedModel
    from cfem.identify.cases.scatter import Scatter

    lacking = discrepancy_of(cases) if spec.discrepancy else None
    rig = lab.rig(find, tuple(dict.fromkeys(cases.sessions)), lacking)
    rig, fitted = fit_with_discrepancy(rig, cases, Scatter(spec.scatter))
    return find, FittedModel(rig, fitted, leave_one_out(rig, cases, fitted))


COMMAND = Command(
    "calibrate-cases",
    5,
    CasesSpec,
    _work,
    ("measurements", "mesh"),
    outside=("scene",),
    extra=lambda spec, base: {"scene": scene_meaning(base / spec.scene)},
)
run, stage = COMMAND.run, COMMAND.stage
