"""`cfem calibrate`: measurements to parameters, with their intervals, fit, and what cannot be found."""

from pathlib import Path
from typing import Any

import numpy as np

from cfem.condensed.parameters import Parameter
from cfem.core.actuator_units import demand_units
from cfem.core.artefact.files import write_json, write_whole
from cfem.core.errors import SpecError
from cfem.core.optional import installed
from cfem.core.stage import Command
from cfem.identify.robot.spec import CalibrateSpec
from cfem.robot.spec import scene_meaning

_PATHS = ("measurements", "model", "scene", "mesh")
TABLE, RESULT, FIGURE = "predicted.parquet", "calibration.json", "calibration.png"


def _paths(spec: CalibrateSpec, base: Path) -> dict[str, Path]:
    """Paths that the spec names and the stage needs."""
    return {name: base / getattr(spec, name) for name in _PATHS if _used(spec, name)}


def _used(spec: CalibrateSpec, name: str) -> bool:
    return getattr(spec, name) is not None and (spec.fe or name != "mesh")


def _work(folder: Path, spec: CalibrateSpec, base: Path) -> dict[str, Any]:
    """Results: value and interval by parameter, what cannot be found, the fit."""
    from cfem.condensed.parameters import value_of, vector
    from cfem.identify.robot.calibration import calibrate, coverage
    from cfem.identify.robot.measurements import read_measurements
    from cfem.identify.robot.results import calibration_results, write_states
    from cfem.identify.robot.text import coverage_line, headline, judgement

    paths = _paths(spec, base)
    family = _family(spec, paths)
    demand_units(spec, family.actuator_units)
    parameters = family.parameters
    measured = read_measurements(
        paths["measurements"], family.rows, spec.driven, spec.split, spec.rows, family.actuator_units
    ).of(spec.use)
    find = _find(spec, parameters)
    p0 = vector(parameters, spec.fixed, "fixed")
    noise = _noise(spec, bool(np.isfinite(measured.dual).any()))
    with_profile = spec.profile if spec.profile is not None else not spec.fe
    starts = _starts(spec, parameters, find, p0)
    calibration = calibrate(family, measured, find, p0, starts, noise, spec.confidence, with_profile)

    by_name = {parameter.name: parameter for parameter in parameters}
    truth = {name: value_of(by_name[name], given, f"truth.{name}") for name, given in spec.truth.items()}
    results = calibration_results(calibration, truth, spec.confidence)
    lines = headline(calibration, results)
    if spec.repeats and any(estimate.deviation is not None for estimate in calibration.estimates):
        shares = zip(calibration.estimates, coverage(calibration, noise, spec.confidence, spec.repeats), strict=True)
        results["coverage"] = {estimate.name: share for estimate, share in shares if estimate.deviation is not None}
        lines.append(coverage_line(results["coverage"], spec.repeats))
    outside = [] if spec.fe else family.outside(calibration.states)
    results |= {"solves": family.solves} if spec.fe else {"outside": outside}
    results = {"judgement": judgement(calibration, outside), **results}
    write_json(folder / RESULT, results)
    write_states(folder / TABLE, calibration)
    if spec.figure and installed("matplotlib"):
        from cfem.identify.robot.figure import calibration_figure

        write_whole(folder / FIGURE, calibration_figure(calibration))
        results["figure"] = FIGURE
    return results | {"headline": lines}


def _family(spec: CalibrateSpec, paths: dict[str, Path]) -> Any:
    """The learned robots, or those of finite elements with the same parameters."""
    from cfem.parametric.load import finite_elements, learned
    from cfem.predict.load import load_model
    from cfem.sample.parameters import scene_parameters

    if not spec.fe:
        return learned(paths["model"], paths.get("scene"))
    if spec.model is not None:
        return finite_elements(paths["scene"], paths["mesh"], load_model(paths["model"]).parameters)
    return finite_elements(paths["scene"], paths["mesh"], scene_parameters(spec.parameters, paths["scene"]))


def _find(spec: CalibrateSpec, parameters: tuple[Parameter, ...]) -> list[int]:
    """Numbers of the parameters to find. SpecError where one is unknown, also fixed, or none is left."""
    from cfem.condensed.parameters import demand_known

    names = [parameter.name for parameter in parameters]
    wanted = spec.find if spec.find is not None else [name for name in names if name not in spec.fixed]
    demand_known(parameters, wanted, "find")
    demand_known(parameters, spec.truth, "truth")
    twice = set(wanted) & set(spec.fixed)
    if twice:
        raise SpecError(
            f"parameters {sorted(twice)} are both to be found and fixed",
            where="fixed",
            do="take them out of `find` or out of `fixed`",
        )
    if not wanted:
        raise SpecError(
            "all parameters are fixed, so there is nothing to find", where="find", do="take one out of `fixed`"
        )
    return [names.index(name) for name in wanted]


def _noise(spec: CalibrateSpec, dual_measured: bool) -> Any:
    """The stated noise, None where none is. SpecError where that of a measured dual is missing."""
    from cfem.identify.robot.residuals import Noise

    if spec.noise is None:
        return None
    name, words = ("forces", "forces") if spec.driven == "displacement" else ("actuator_displacements", "displacements")
    dual = getattr(spec.noise, name)
    if dual is None and dual_measured:
        raise SpecError(
            f"the noise of the actuators' {words} is missing",
            where=f"noise.{name}",
            do="state its standard deviation, or leave `noise` out",
        )
    return Noise(spec.noise.effectors, dual or 1.0, known=True)


def _starts(spec: CalibrateSpec, parameters: tuple[Parameter, ...], find: list[int], p0: np.ndarray) -> np.ndarray:
    """Starts (k, n_p) of the search. SpecError where one names a parameter that is not to be found."""
    from cfem.condensed.parameters import from_shares, vector
    from cfem.parametric.least_squares import spread_starts

    if isinstance(spec.starts, list):
        given = [vector(parameters, start, f"starts.{i}") for i, start in enumerate(spec.starts)]
        named = {name for start in spec.starts for name in start}
        strange = named - {parameters[i].name for i in find}
        if strange:
            raise SpecError(
                f"parameters {sorted(strange)} are not among those to find",
                where="starts",
                do="name parameters of `find`",
            )
        return np.array(given)
    starts = np.tile(p0, (spec.starts, 1))
    starts[:, find] = from_shares([parameters[i] for i in find], spread_starts(spec.starts, len(find)))
    return starts


COMMAND = Command(
    "calibrate",
    3,
    CalibrateSpec,
    _work,
    outside=_PATHS,
    reads=lambda spec, base: {name: path for name, path in _paths(spec, base).items() if name != "scene"},
    extra=lambda spec, base: {"scene": scene_meaning(base / spec.scene)} if spec.scene else {},
)
run, stage = COMMAND.run, COMMAND.stage
