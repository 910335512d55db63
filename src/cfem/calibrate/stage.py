"""`cfem calibrate`: measurements to parameters, with their intervals, fit, and what cannot be found."""

from pathlib import Path
from typing import Any

import numpy as np

from cfem.calibrate.spec import CalibrateSpec
from cfem.condensed.parameters import Parameter
from cfem.core.actuator_units import demand_units
from cfem.core.errors import SpecError
from cfem.core.files import write_json, write_whole
from cfem.core.judgement import NOISE_RATIO, poor
from cfem.core.optional import installed
from cfem.core.shown import duration
from cfem.core.stage import Command
from cfem.robot.spec import scene_meaning

_PATHS = ("measurements", "model", "scene", "mesh")
TABLE, RESULT, FIGURE = "predicted.parquet", "calibration.json", "calibration.png"


def _paths(spec: CalibrateSpec, base: Path) -> dict[str, Path]:
    """Of what the spec names and needs."""
    return {name: base / getattr(spec, name) for name in _PATHS if _used(spec, name)}


def _used(spec: CalibrateSpec, name: str) -> bool:
    return getattr(spec, name) is not None and (spec.fe or name != "mesh")


def _work(folder: Path, spec: CalibrateSpec, base: Path) -> dict[str, Any]:
    """Results: value and interval by parameter, what cannot be found, the fit."""
    from cfem.calibrate.calibration import calibrate, coverage
    from cfem.calibrate.measurements import read_measurements
    from cfem.calibrate.residuals import Noise
    from cfem.condensed.parameter_values import demand_known, vector

    paths = _paths(spec, base)
    family = family_of(spec, paths)
    demand_units(spec, family.actuator_units)
    parameters = family.parameters
    measured = read_measurements(
        paths["measurements"], family.rows, spec.driven, spec.split, spec.rows, family.actuator_units
    ).of(spec.use)
    names = [one.name for one in parameters]
    wanted = spec.find if spec.find is not None else [name for name in names if name not in spec.fixed]
    demand_known(parameters, wanted, "find")
    demand_known(parameters, spec.truth, "truth")
    both = set(wanted) & set(spec.fixed)
    if both:
        raise SpecError(
            f"parameters {sorted(both)} are both to be found and fixed",
            where="fixed",
            do="take them out of `find` or out of `fixed`",
        )
    if not wanted:
        raise SpecError(
            "all parameters are fixed, so there is nothing to find", where="find", do="take one out of `fixed`"
        )
    find = [names.index(name) for name in wanted]
    p0 = vector(parameters, spec.fixed, "fixed")
    noise = None
    if spec.noise:
        dual = spec.noise.forces if spec.driven == "displacement" else spec.noise.actuator_displacements
        if dual is None and np.isfinite(measured.dual).any():
            what = "forces" if spec.driven == "displacement" else "actuator_displacements"
            raise SpecError(
                f"the noise of the actuators' {what} is missing",
                where=f"noise.{what}",
                do="state its standard deviation, or leave `noise` out",
            )
        noise = Noise(spec.noise.effectors, dual or 1.0, known=True)
    with_profile = spec.profile if spec.profile is not None else not spec.fe
    found = calibrate(
        family, measured, find, p0, _starts(spec, parameters, find, p0), noise, spec.confidence, with_profile
    )
    results = summary(found, spec)
    if spec.repeats and found.estimates:
        shares = coverage(found, noise, spec.confidence, spec.repeats)
        results["coverage"] = dict(zip([one.name for one in found.estimates], shares, strict=True))
        said = ", ".join(f"{name} in {100 * share:.1f} %" for name, share in results["coverage"].items())
        results["headline"].append(f"{spec.repeats} simulated repeats: the interval covers {said}")
    if not spec.fe:
        results["outside"] = family.outside(found.states)
        if results["outside"]:
            results["headline"].append(f"states {results['outside']} lie outside what the model was trained on")
    else:
        results["solves"] = family.solves
    write_json(folder / RESULT, {key: value for key, value in results.items() if key != "headline"})
    _write_table(folder / TABLE, found)
    if spec.figure and installed("matplotlib"):
        from cfem.calibrate.figure import calibration_figure

        write_whole(folder / FIGURE, calibration_figure(found))
        results["figure"] = FIGURE
    return results


def family_of(spec: Any, paths: dict[str, Path]) -> Any:
    """The learned robots, or those of finite elements with the same parameters."""
    from cfem.parametric.load import finite_elements, learned
    from cfem.predict.load import load_model
    from cfem.sample.parameters import scene_parameters

    if not spec.fe:
        return learned(paths["model"], paths.get("scene"))
    if spec.model is not None:
        return finite_elements(paths["scene"], paths["mesh"], load_model(paths["model"]).parameters)
    return finite_elements(paths["scene"], paths["mesh"], scene_parameters(spec.parameters, paths["scene"]))


def _starts(spec: CalibrateSpec, parameters: tuple[Parameter, ...], find: list[int], p0: np.ndarray) -> np.ndarray:
    """(k, n_p)."""
    from cfem.calibrate.fit import spread
    from cfem.condensed.parameter_values import vector
    from cfem.condensed.parameters import from_shares

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
    starts[:, find] = from_shares([parameters[i] for i in find], spread(spec.starts, len(find)))
    return starts


def summary(found: Any, spec: CalibrateSpec) -> dict[str, Any]:
    """All that the manifest says."""
    from cfem.condensed.parameter_values import value_of

    parameters = {one.name: one for one in found.problem.family.parameters}
    truth = {name: value_of(parameters[name], given, f"truth.{name}") for name, given in spec.truth.items()}
    estimates, headline = {}, []
    for one in found.estimates:
        entry = {
            "value": one.value,
            "unit": one.unit,
            "interval": list(one.interval),
            "profile": None if one.profile is None else list(one.profile),
            "at_end_of_range": one.at_end,
        }
        line = f"{one.name} {one.value:.6g}{_unit(one.unit)}, {_interval(one.interval, spec.confidence)}"
        if one.profile is not None:
            line += f" (by profile {_within(one.profile, parameters[one.name])})"
        if one.name in truth:
            entry["truth"], entry["error"] = truth[one.name], one.value - truth[one.name]
            line += f", error {abs(entry['error']):.1e}{_unit(one.unit)}"
        if one.at_end:
            line += "; it lies at an end of its range"
        estimates[one.name] = entry
        headline.append(line)
    spread, known = found.spread, found.identifiability
    headline += known.sentences
    if spread is not None and spread.chance is not None and spread.scale != 1.0:
        headline.append(
            f"the residuals are {spread.scale:.2g} times the noise stated (chance {spread.chance:.0e}): "
            "the model or the noise is wrong; intervals widened by as much"
        )
    judged = []
    if spread is not None and not spread.scale <= NOISE_RATIO and spread.chance is not None:
        judged.append(
            poor(f"the residuals are {spread.scale:.2g} times the stated noise: the model does not fit the data")
        )
    if spread is not None and spread.covariance is None:
        headline.append("as many parameters as measurements: no intervals without a stated noise")
    rms = {}
    for name in dict.fromkeys(label for _, label in found.problem.labels):
        picked = [i for i, (_, label) in enumerate(found.problem.labels) if label == name]
        rms[name] = float(np.sqrt((found.residuals[picked] ** 2).mean()))
    starts = _account(found)
    headline.append(
        f"{len(found.problem.measured)} states, {len(found.problem.target)} numbers, {len(found.fits)} starts, "
        f"{duration(found.seconds)} of CPU time"
    )
    return {
        "judgement": judged,
        "headline": headline,
        "estimates": estimates,
        "p": dict(zip(parameters, found.p, strict=True)),
        "unseen": list(found.unseen),
        "identifiability": {
            "singular_values": known.singular_values,
            "rank": known.rank,
            "sentences": known.sentences,
        },
        "correlation": None if spread is None else spread.correlation,
        "residual_rms": rms,
        "noise": None if found.noise is None else {"effectors": found.noise.effectors, "actuators": found.noise.dual},
        "chance": None if spread is None else spread.chance,
        "degrees_of_freedom": None if spread is None else spread.degrees,
        "confidence": spec.confidence,
        "starts": starts,
        "evaluations": found.evaluations,
        "search_seconds": found.seconds,
        "profile_seconds": found.profile_seconds,
    }


def _account(found: Any) -> list[dict[str, Any]]:
    """What each start led to."""
    best = min((one.cost for one in found.fits if one.failure is None), default=None)

    def named(z: np.ndarray) -> dict[str, float]:
        p = found.problem.p(z)[list(found.problem.free)]
        return dict(zip([one.name for one in found.problem.parameters], p, strict=True))

    return [
        {
            "start": named(one.start),
            "found": named(one.z),
            "cost": one.cost if np.isfinite(one.cost) else None,
            "evaluations": len(one.costs),
            "seconds": one.seconds,
            "failure": one.failure,
            "best": one.failure is None and one.cost <= best * (1 + 1e-6) + 1e-18,
        }
        for one in found.fits
    ]


def _unit(unit: str) -> str:
    return "" if unit == "1" else f" {unit}"


def _within(ends: tuple[float | None, float | None], parameter: Parameter) -> str:
    """Ends that lie beyond the range as that of the range."""
    low, high = ends
    return f"[{parameter.low if low is None else low:.6g}, {parameter.high if high is None else high:.6g}]"


def _interval(interval: tuple[float | None, float | None], confidence: float) -> str:
    if None in interval:
        return "no interval"
    return f"{100 * confidence:g} % interval [{interval[0]:.6g}, {interval[1]:.6g}]"


def _write_table(path: Path, found: Any) -> None:
    """A row a state: what drove it, where it went, what was measured."""
    from cfem.condensed.packing import pack_upper
    from cfem.dataset.writer import write_columns

    measured, states = found.problem.measured, found.states
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
    units = {"delta_a": "mm", "lambda_a": "N", "delta_e": "mm", "x_e": "mm", "measured_x_e": "mm"}
    units |= {"measured_delta_e": "mm", "delta_free": "mm", "W": "mm/N"}
    units["measured_dual"] = "N" if measured.kind == "displacement" else "mm"
    meta = {
        "rows": list(states.rows.names),
        "driven": measured.kind,
        "p": dict(zip([one.name for one in found.problem.family.parameters], found.p.tolist(), strict=True)),
        "units": units,
    }
    write_columns(path, columns, meta)


COMMAND = Command(
    "calibrate",
    2,
    CalibrateSpec,
    _work,
    outside=_PATHS,
    reads=lambda spec, base: {name: path for name, path in _paths(spec, base).items() if name != "scene"},
    extra=lambda spec, base: {"scene": scene_meaning(base / spec.scene)} if spec.scene else {},
)
run, stage = COMMAND.run, COMMAND.stage
