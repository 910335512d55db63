"""From measurements to parameters with their intervals."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cfem.calibrate.confidence import Spread, profile, spread_of
from cfem.calibrate.fit import Fit, best_of, fit
from cfem.calibrate.identifiability import Identifiability, identifiability, unseen, why_unseen
from cfem.calibrate.measurements import Measurements
from cfem.calibrate.residuals import Noise, Residuals, relative
from cfem.core.errors import NumericalError
from cfem.parametric.family import Family
from cfem.parametric.states import States


@dataclass(frozen=True)
class Estimate:
    """One parameter. value; interval: its confidence interval by the linearised covariance, within the parameter's
    range, None where it is not determined; profile: by the profile of the likelihood, None at an end that lies beyond
    the range; deviation: of its share of the range; at_end: whether it lies
    at an end of its range."""

    name: str
    unit: str
    value: float
    interval: tuple[float | None, float | None]
    profile: tuple[float | None, float | None] | None
    deviation: float | None
    at_end: bool


@dataclass(frozen=True)
class Calibration:
    """p: (n_p,) all parameters, those not found as they were given; estimates: of the found ones; unseen: names that
    nothing measured depends on; states: the robot's at p; residuals: (n_r,) computed less measured, in measured units;
    noise: the one stated or, from what the fit leaves, estimated; seconds: of CPU time of the search, and of profiles;
    evaluations: robots and states that the search asked for."""

    p: np.ndarray
    estimates: tuple[Estimate, ...]
    unseen: tuple[str, ...]
    fits: tuple[Fit, ...]
    problem: Residuals
    spread: Spread | None
    identifiability: Identifiability
    states: States
    residuals: np.ndarray
    noise: Noise | None
    seconds: float
    profile_seconds: float
    evaluations: int


def calibrate(
    family: Family,
    measured: Measurements,
    find: Sequence[int],
    p0: np.ndarray,
    starts: np.ndarray,
    noise: Noise | None = None,
    confidence: float = 0.95,
    with_profile: bool = True,
) -> Calibration:
    """find: numbers of the parameters asked for; p0 (n_p,): values of all others; starts: (k, n_p). A parameter that
    nothing measured depends on stays as in p0. NumericalError where no start leads to an answer."""
    begin = time.process_time()
    noise = noise or relative(measured)
    everything = Residuals(family, measured, noise, p0, list(find))
    seen = _seen(everything, starts)
    problem = Residuals(family, measured, noise, p0, [i for i, sees in zip(find, seen, strict=True) if sees])
    names = [family.parameters[i].name for i in find]
    blind = [family.parameters[i] for i, sees in zip(find, seen, strict=True) if not sees]
    sources = [
        source
        for source, columns in (("effectors", (measured.x_e, measured.delta_e)), ("actuators", (measured.dual,)))
        if any(np.isfinite(column).any() for column in columns)
    ]
    sentences = [why_unseen(one, measured.kind, sources) for one in blind]
    if not problem.free:
        z = np.zeros(0)
        states = problem.states(z[None])
        left = problem.predictions(states)[0] - problem.target
        known = Identifiability(np.zeros(0), 0, sentences)
        took = time.process_time() - begin
        evaluations = everything.evaluations + problem.evaluations
        return Calibration(p0, (), tuple(names), (), problem, None, known, states, left, None, took, 0.0, evaluations)
    fits = [fit(problem.with_jacobian, z) for z in problem.z(starts)]
    z = best_of(fits).z
    residuals, jacobian = problem.with_jacobian(z)
    spread = spread_of(residuals, jacobian, noise.known, confidence)
    known = identifiability(jacobian, problem.parameters, spread)
    seconds, evaluations = time.process_time() - begin, everything.evaluations + problem.evaluations
    begin = time.process_time()
    profiles = [
        profile(problem.with_jacobian, z, i, spread) if with_profile and np.isfinite(spread.deviations[i]) else None
        for i in range(len(z))
    ]
    profile_seconds = time.process_time() - begin
    states = problem.states(z[None])
    return Calibration(
        problem.p(z),
        tuple(_estimate(problem, z, i, spread, profiles[i]) for i in range(len(z))),
        tuple(one.name for one in blind),
        tuple(fits),
        problem,
        spread,
        replace(known, sentences=sentences + known.sentences),
        states,
        problem.predictions(states)[0] - problem.target,
        _estimated(noise, spread),
        seconds,
        profile_seconds,
        evaluations,
    )


def coverage(found: Calibration, noise: Noise, confidence: float, repeats: int) -> np.ndarray:
    """(n_free,) share of `repeats` in which the interval covers what was found. Each repeat takes that as the truth
    and draws new measurements with the stated noise."""
    problem, rng = found.problem, np.random.default_rng(0)
    truth = problem.z(found.p)
    computed = problem.target + found.residuals
    covered = np.zeros(len(truth))
    for _ in range(repeats):
        other = problem.of_other(computed + problem.sigma * rng.standard_normal(len(computed)))
        z = best_of([fit(other.with_jacobian, truth)]).z
        spread = spread_of(*other.with_jacobian(z), noise.known, confidence)
        covered += np.abs(z - truth) <= spread.quantile * spread.deviations
    return covered / repeats


def _seen(problem: Residuals, starts: np.ndarray) -> np.ndarray:
    """(n,) whether what was measured depends on each parameter, at some start."""
    centred = problem.target - problem.target.mean() if len(problem.target) > 1 else problem.target
    change = float(np.abs(centred / problem.sigma).max())
    jacobians, failure = [], None
    for z in problem.z(starts)[:2]:
        try:
            jacobians.append(problem.with_jacobian(np.clip(z, 0.01, 0.99))[1])
        except NumericalError as error:
            failure = error
    if not jacobians and failure:
        raise failure
    return ~unseen(jacobians, change)


def _estimated(noise: Noise, spread: Spread) -> Noise | None:
    if noise.known:
        return noise
    if spread.covariance is None:
        return None
    return Noise(noise.effectors * spread.scale, noise.dual * spread.scale, False)


def _estimate(problem: Residuals, z: np.ndarray, i: int, spread: Spread, profiled: tuple | None) -> Estimate:
    parameter = problem.parameters[i]

    def value(share: float | None) -> float | None:
        if share is None:
            return None
        moved = z.copy()
        moved[i] = share
        return float(problem.p(moved)[problem.free[i]])

    half = spread.quantile * spread.deviations[i]
    return Estimate(
        parameter.name,
        parameter.unit,
        value(z[i]),
        (value(max(z[i] - half, 0.0)), value(min(z[i] + half, 1.0))) if np.isfinite(half) else (None, None),
        None if profiled is None else (value(profiled[0]), value(profiled[1])),
        float(spread.deviations[i]) if np.isfinite(spread.deviations[i]) else None,
        bool(min(z[i], 1 - z[i]) < 1e-5),
    )
