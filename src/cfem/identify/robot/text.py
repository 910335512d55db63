"""Text about a calibration, for a person."""

from collections.abc import Mapping, Sequence
from typing import Any

from cfem.condensed.parameters import Parameter
from cfem.core.artefact.judgement import NOISE_RATIO, poor
from cfem.core.console.shown import counted, duration
from cfem.identify.robot.calibration import Calibration
from cfem.identify.robot.misfit import LARGE, misfits


def headline(calibration: Calibration, results: Mapping[str, Any]) -> list[str]:
    """A line for each parameter, then what cannot be told, the fit and its cost; results: `calibration_results`."""
    problem, known = calibration.problem, calibration.uncertainty
    parameters = {parameter.name: parameter for parameter in problem.family.parameters}
    confidence = results["confidence"]
    lines = [
        f"{known.name} {known.value:.6g}, {_interval(known.interval or (None, None), confidence)}"
        for known in calibration.combinations
    ]
    lines += [_estimate(parameters[name], entry, confidence) for name, entry in results["estimates"].items()]
    lines += calibration.sentences
    if known is not None and known.chance is not None and known.scale != 1.0:
        lines.append(
            f"the residuals are {known.scale:.2g} times the noise stated (chance {known.chance:.0e}): "
            "the model or the noise is wrong; intervals widened by as much"
        )
    if known is not None and known.covariance is None:
        lines.append("as many parameters as measurements: no intervals without a stated noise")
    lines.append(f"the fit leaves {' and '.join(misfit.words for misfit in misfits(calibration))}, root mean square")
    lines.append(
        f"{counted(len(problem.measured), 'state')}, {counted(len(problem.target), 'number')}, "
        f"{counted(len(calibration.fits), 'start')}, "
        f"{duration(calibration.seconds)} of CPU time"
    )
    return lines


def judgement(calibration: Calibration, outside: Sequence[int]) -> list[dict[str, Any]]:
    """Poor where a parameter cannot be found, where states are unlike those that the model was trained on, numbers from
    0, and where the fit leaves far more than the noise that was stated, or much of what was measured."""
    findings, known = [poor(sentence) for sentence in calibration.lost], calibration.uncertainty
    if known is not None and not (known.chance is not None and known.scale == 1.0):  # else it is the noise
        large = [misfit for misfit in misfits(calibration) if misfit.share > LARGE]
        do = "check units, axes and signs of the measurements, and that they are in the frame of the scene"
        left = " and ".join(misfit.words for misfit in large)
        findings += [poor(f"the fit leaves {left}, root mean square: {do}")] if large else []
    if outside:
        rows = ", ".join(str(state + 1) for state in outside)
        findings.append(poor(f"states (rows of the measurements) outside what the model was trained on: {rows}"))
    if known is not None and known.chance is not None and known.scale > NOISE_RATIO:
        what = f"the residuals are {known.scale:.2g} times the stated noise: the model does not fit the data"
        findings.append(poor(what))
    return findings


def coverage_line(shares: Mapping[str, float], repeats: int) -> str:
    """The line on simulated repeats; shares: of repeats in which each parameter's interval covers it."""
    covered = ", ".join(f"{name} in {100 * share:.1f} %" for name, share in shares.items())
    return f"{repeats} simulated repeats: the interval covers {covered}"


def _estimate(parameter: Parameter, entry: Mapping[str, Any], confidence: float) -> str:
    """The line on a parameter: value, intervals, error where the truth is known."""
    unit = parameter.suffix
    if not entry["determined"]:
        return f"{parameter.name} is not known: {entry['value']:.6g}{unit} fits, and so do others"
    line = f"{parameter.name} {entry['value']:.6g}{unit}, {_interval(entry['interval'], confidence)}"
    if entry["profile"] is not None:
        low, high = entry["profile"]  # None beyond the end of the range
        low, high = parameter.low if low is None else low, parameter.high if high is None else high
        line += f" (by profile [{low:.6g}, {high:.6g}])"
    if "error" in entry:
        line += f", error {abs(entry['error']):.1e}{unit}"
    return line + ("; it lies at an end of its range" if entry["at_end_of_range"] else "")


def _interval(interval: Sequence[float | None], confidence: float) -> str:
    low, high = interval
    return "no interval" if low is None else f"{100 * confidence:g} % interval [{low:.6g}, {high:.6g}]"
