"""`cfem predict-cases`: a table of other load cases to predictions with intervals, and to errors where they were
measured."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.artefact.content import artefact_file
from cfem.core.artefact.files import write_json, write_whole
from cfem.core.errors import InputError, NumericalError
from cfem.core.optional import installed
from cfem.core.spec import load_spec, meaning
from cfem.core.stage import Command
from cfem.identify.cases.outcome import FILE
from cfem.identify.cases.prediction.spec import PredictSpec
from cfem.identify.cases.spec import CasesSpec
from cfem.robot.spec import scene_meaning

RESULT, TABLE, FIGURE = "prediction.json", "predicted.csv", "shapes.png"


def _extra(spec: PredictSpec, base: Path) -> dict[str, Any]:
    path = base / spec.cases
    cases = load_spec(path, CasesSpec)
    scene = scene_meaning(path.parent / cases.scene)
    return {"scene": scene, "cases": meaning(cases, ("scene", "mesh", "measurements", "out"))}


def _work(folder: Path, spec: PredictSpec, base: Path) -> dict[str, Any]:
    """Results: errors by case and marker, share within the intervals."""
    from cfem.identify.cases.average import FILE as AVERAGE
    from cfem.identify.cases.average import averaged, read_average
    from cfem.identify.cases.load import load_lab
    from cfem.identify.cases.outcome import read_calibrated
    from cfem.identify.cases.prediction.results import headline, prediction_results
    from cfem.identify.cases.prediction.table import write_predictions

    path = base / spec.cases
    lab = load_lab(load_spec(path, CasesSpec), path.parent)
    known = read_calibrated(artefact_file(base / spec.calibrated, FILE))
    cases = lab.read(base / spec.table, measured=False)
    if spec.average:
        average, models = read_average(artefact_file(base / spec.calibrated, AVERAGE))
        of_models = [
            _predicted(lab, find, read_calibrated(artefact_file(base / spec.calibrated, file)), cases, spec)
            for find, file in models
        ]
        prediction = averaged(of_models, average, spec.confidence)
    else:
        prediction = _predicted(lab, lab.find, known, cases, spec)
    failed = prediction.failed
    if len(failed) == len(cases):
        raise NumericalError(f"no case has an equilibrium; the first: {next(iter(failed.values()))}")
    write_predictions(folder / TABLE, cases, lab.markers, prediction)
    if spec.figure and installed("matplotlib"):
        from cfem.identify.cases.figure import shapes_figure

        poses = tuple(None if i in failed else pose for i, pose in enumerate(prediction.poses))
        shapes = poses, prediction.y, prediction.half, spec.confidence
        drawn = shapes_figure(cases, *shapes, lab.mesh, "Predicted", lab.down)
        write_whole(folder / FIGURE, drawn)
    results = prediction_results(prediction, cases, lab.markers, known)
    write_json(folder / RESULT, results)
    measured = int(np.isfinite(prediction.distance).sum())
    return results | {"headline": headline(results, measured, spec.confidence, TABLE)}


def _predicted(lab: Any, find: Sequence[str], known: Any, cases: Any, spec: PredictSpec) -> Any:
    """Predictions of the cases by one model. InputError where it was calibrated by other parameters."""
    from cfem.identify.cases.prediction.predict import predict

    rig = lab.rig(find, tuple(dict.fromkeys([*known.sessions, *cases.sessions])), known.discrepancy)
    strange = [name for name in known.names if name not in {unknown.name for unknown in rig.unknowns}]
    if strange:
        what = f"was made with the unknown '{strange[0]}', which {spec.cases} does not find"
        raise InputError(what, where=str(spec.calibrated), do="run cfem calibrate-cases again")
    return predict(rig, cases, known, spec.confidence, spec.beyond)


COMMAND = Command("predict-cases", 5, PredictSpec, _work, ("calibrated", "table"), outside=("cases",), extra=_extra)
run, stage = COMMAND.run, COMMAND.stage
