"""Parameters from measurements, with their intervals."""

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cfem.core.errors import NumericalError
from cfem.identify.fit.free_parameter import ParameterEstimate, estimate
from cfem.identify.fit.identifiability import advice, share_sentences, unseen, unseen_sentence
from cfem.identify.fit.uncertainty import Uncertainty, profile, uncertainty
from cfem.identify.fit.unmeasured import Combination, Unmeasured, known_combinations, unmeasured, unmeasured_sentences
from cfem.identify.robot.measurements import Measurements
from cfem.identify.robot.residuals import Noise, RobotResiduals, relative_noise
from cfem.parametric.family import Family
from cfem.parametric.least_squares import FitResult, FitSettings, best_of, fit
from cfem.parametric.states import States

_SEARCH = FitSettings(try_ends=True)


@dataclass(frozen=True)
class Calibration:
    """A calibrated robot.

    p:           (n_p,) all parameters, those not found as they were given
    estimates:   of the found parameters
    unseen:      names of parameters that nothing measured depends on
    combinations: what is known of parameters that only act together
    fits:        one from each start
    problem:     the residuals, by the parameters that were found
    uncertainty: of their shares of the ranges, None where none was found
    lost:        sentences on what cannot be found
    sentences:   what the measurements tell of the other parameters
    states:      the robot's at p
    residuals:   (n_r,) computed less measured, in measured units
    noise:       stated or estimated, None where it is neither
    seconds:     of CPU time of the search
    profile_seconds: of CPU time of the profiles
    evaluations: robots and states that the search asked for"""

    p: np.ndarray
    estimates: tuple[ParameterEstimate, ...]
    unseen: tuple[str, ...]
    combinations: list[Combination]
    fits: tuple[FitResult, ...]
    problem: RobotResiduals
    uncertainty: Uncertainty | None
    lost: list[str]
    sentences: list[str]
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
    """The parameters that fit the measurements best. A parameter that nothing measured depends on stays as in p0.
    NumericalError where no start leads to an answer.

    find:   numbers of the parameters to find
    p0:     (n_p,) values of all others
    starts: (k, n_p) of the search
    noise:  estimated from the fit unless given"""
    begin = time.process_time()
    noise = noise or relative_noise(measured)
    everything = RobotResiduals(family, measured, noise, p0, list(find))
    seen = _seen(everything, starts)
    hidden = [family.parameters[i] for i, is_seen in zip(find, seen, strict=True) if not is_seen]
    problem = RobotResiduals(family, measured, noise, p0, [i for i, is_seen in zip(find, seen, strict=True) if is_seen])
    lost = [unseen_sentence(parameter, measured.kind, _sources(measured)) for parameter in hidden]
    fits, known, profiles, z, sentences, combinations, deviations = [], None, [], np.zeros(0), [], [], np.zeros(0)
    if problem.free:
        fits = [fit(problem, start, _SEARCH) for start in problem.z(starts)]
        z = best_of(fits).u
        known, blind = _uncertainty(problem, z, confidence)
        carried = blind.carried(np.eye(len(z)))
        deviations = known.deviations + carried / known.quantile
        lost += unmeasured_sentences(blind, problem.parameters, advice(measured.kind, _sources(measured)))
        combinations = known_combinations(blind, problem.parameters, problem.p(z)[problem.free], known)
        sentences = share_sentences(problem.parameters, known, carried)
    profile_begin, evaluations = time.process_time(), everything.evaluations + problem.evaluations
    if known is not None:
        profiled = with_profile & np.isfinite(known.deviations)
        profiles = [profile(problem, z, i, known) if asked else None for i, asked in enumerate(profiled)]
    profile_end = time.process_time()
    states = problem.states(z[None])
    return Calibration(
        p=problem.p(z),
        estimates=tuple(
            estimate(unknown, z[i], deviations[i], known.quantile, profiles[i])
            for i, unknown in enumerate(problem.unknowns)
        ),
        unseen=tuple(parameter.name for parameter in hidden),
        combinations=combinations,
        fits=tuple(fits),
        problem=problem,
        uncertainty=known,
        lost=lost,
        sentences=sentences,
        states=states,
        residuals=problem.predictions(states)[0] - problem.target,
        noise=_estimated(noise, known),
        seconds=profile_begin - begin,
        profile_seconds=profile_end - profile_begin,
        evaluations=evaluations,
    )


def coverage(calibration: Calibration, noise: Noise, confidence: float, repeats: int) -> np.ndarray:
    """Shares (n_free,) of repeats in which the interval covers the calibrated value. Each repeat takes that for the
    truth and draws new measurements with the stated noise."""
    problem, rng = calibration.problem, np.random.default_rng(0)
    truth = problem.z(calibration.p)
    computed = problem.target + calibration.residuals
    covered = np.zeros(len(truth))
    for _ in range(repeats):
        repeated = problem.with_target(computed + problem.sigma * rng.standard_normal(len(computed)))
        z = best_of([fit(repeated, truth, _SEARCH)]).u
        known, _ = _uncertainty(repeated, z, confidence)
        covered += np.abs(z - truth) <= known.quantile * known.deviations
    return covered / repeats


def _uncertainty(problem: RobotResiduals, z: np.ndarray, confidence: float) -> tuple[Uncertainty, Unmeasured]:
    """Uncertainty at the answer z (n_free,), and the directions that move nothing measured."""
    residuals, jacobian, error = problem.with_error(z)
    blind = unmeasured((jacobian, error), lambda other: problem.with_error(other)[1:], z, problem.parameters)
    apart = blind.directions if len(blind) else None
    return uncertainty(residuals, jacobian, problem.noise.known, confidence, unmeasured=apart), blind


def _sources(measured: Measurements) -> list[str]:
    """Sources that were measured, of 'effectors' and 'actuators'."""
    columns = {"effectors": (measured.x_e, measured.delta_e), "actuators": (measured.dual,)}
    return [source for source, arrays in columns.items() if any(np.isfinite(array).any() for array in arrays)]


def _seen(problem: RobotResiduals, starts: np.ndarray) -> np.ndarray:
    """Mask (n,) of the parameters that what was measured depends on, at some start."""
    centred = problem.target - problem.target.mean() if len(problem.target) > 1 else problem.target
    change = float(np.abs(centred / problem.sigma).max())
    jacobians, errors, failure = [], [], None
    for z in np.clip(problem.z(starts)[:2], 0.01, 0.99):
        try:
            _, jacobian, error = problem.with_error(z)
            jacobians.append(jacobian)
            errors.append(error)
        except NumericalError as error:
            failure = error
    if not jacobians and failure:
        raise failure
    return ~unseen(jacobians, change, errors)


def _estimated(noise: Noise, known: Uncertainty | None) -> Noise | None:
    """The noise: stated, or by what the fit leaves; None where the measurements are too few to tell."""
    if known is None:
        return None
    if noise.known:
        return noise
    return Noise(noise.effectors * known.scale, noise.dual * known.scale, False) if np.isfinite(known.scale) else None
