"""Newton's method on (x, p, mu) for one actuation, reusing each factorisation while it converges.

With A dx = -R + H C^T dmu and C (delta + H^T dx) = target, the border is eliminated: S = C H^T A^-1 H C^T is m x m.
The correction at a trial point, by the same factor, judges the step that led there (the affine-invariant monotonicity
test: Deuflhard, Newton Methods for Nonlinear Problems, 2004, section 3.3) and is the next chord step for nothing. Its
ratio to the correction before, theta, decides: below `slow` the factor serves on; above, the tangent is factored anew;
a step from a fresh factor that does not contract, or inverts an element, is halved."""

from dataclasses import dataclass

import numpy as np

from cfem.equilibrium.actuation import Actuation
from cfem.equilibrium.problem import Cost, Evaluation, Problem, Tangent
from cfem.equilibrium.solution import State, Status
from cfem.mechanics.factorization import SingularMatrixError


@dataclass(frozen=True)
class Settings:
    """tolerance:      of the relative residual
    rounding_tolerance: residual that is accepted where corrections have sunk to the rounding of positions
    max_iterations: of one load step
    slow:           contraction above which the tangent is factored anew (0.4: fewest seconds on the finger)
    smallest_step:  fraction of the whole load at which continuation gives up
    first_step:     fraction that a cold start tries first"""

    tolerance: float = 1e-10
    rounding_tolerance: float = 1e-8
    max_iterations: int = 30
    slow: float = 0.4
    smallest_step: float = 1e-3
    first_step: float = 0.5


@dataclass(frozen=True)
class NewtonResult:
    """at, lambda_a: last iterate; tangent: the last factored one; residual: relative, at the last iterate."""

    status: Status
    at: Evaluation
    lambda_a: np.ndarray
    tangent: Tangent | None
    residual: float
    iterations: int

    @property
    def state(self) -> State:
        return State(self.at.x, self.at.pressure, self.lambda_a)


@dataclass(frozen=True)
class _Correction:
    """step (n, 3) mm, pressure (m,) MPa, multipliers (n_a,) N: the change that the factor at hand proposes."""

    step: np.ndarray
    pressure: np.ndarray
    multipliers: np.ndarray

    @property
    def size(self) -> float:
        return float(np.linalg.norm(self.step))


def newton(problem: Problem, start: State, actuation: Actuation, settings: Settings, cost: Cost) -> NewtonResult:
    """Solve for `actuation` from `start`. Never raises for numerical failure: see `status`."""
    lambda_a = _admissible(start.lambda_a, actuation)
    at = problem.evaluate(problem.hold(start.x), start.pressure)
    rounding = 1e-13 * problem.robot.body.mesh.size
    tangent, residual = None, np.inf
    for iteration in range(settings.max_iterations + 1):
        fresh = tangent is None
        if fresh:
            try:
                tangent = problem.factor(at, lambda_a, cost)
            except SingularMatrixError:
                return NewtonResult(Status.SINGULAR, at, lambda_a, None, residual, iteration)
            ZC = (
                tangent.factor.solve(at.H @ actuation.C.T) if len(actuation.C) else np.zeros((problem.pattern.n_dof, 0))
            )
            correction = _correct(problem, at, lambda_a, tangent, actuation, ZC)
        residual = relative_residual(problem, at, lambda_a, tangent)
        if _closed(problem, actuation, at) and (
            residual <= settings.tolerance or (correction.size <= rounding and residual <= settings.rounding_tolerance)
        ):
            return NewtonResult(Status.CONVERGED, at, lambda_a, tangent, residual, iteration)
        cost.iterations += 1
        for halvings in range(5 if fresh else 1):
            part = 0.5**halvings
            trial = problem.evaluate(at.x + part * correction.step, at.pressure + part * correction.pressure)
            if not trial.response.min_J > 0.0:
                continue
            lambda_trial = lambda_a + part * correction.multipliers
            following = _correct(problem, trial, lambda_trial, tangent, actuation, ZC)
            if following.size <= max((1 - part / 4) * correction.size, rounding):
                break
        else:
            if fresh:
                return NewtonResult(Status.STEP_TOO_SMALL, at, lambda_a, tangent, residual, iteration)
            tangent = None
            continue
        slow = following.size > max(settings.slow * correction.size, rounding)
        at, lambda_a, correction, tangent = trial, lambda_trial, following, (None if slow else tangent)
    return NewtonResult(Status.TOO_MANY_ITERATIONS, at, lambda_a, tangent, residual, settings.max_iterations)


def _correct(
    problem: Problem,
    at: Evaluation,
    lambda_a: np.ndarray,
    tangent: Tangent,
    actuation: Actuation,
    ZC: np.ndarray,
):
    """The (chord) Newton correction at `at` with the factor of `tangent`; ZC = A^-1 H C^T belongs to that factor."""
    C = actuation.C
    imbalance = at.residual(lambda_a) + problem.pressure_residual(at, tangent)
    free = -tangent.factor.solve(imbalance[:, None])[:, 0]
    dmu = np.zeros(0)
    if len(C):
        gap = actuation.target - C @ at.delta_a
        dmu = np.linalg.solve(C @ at.H.T @ ZC, gap - C @ (at.H.T @ free))
    step = problem.spread(free + ZC @ dmu)
    return _Correction(step, problem.pressure_step(at, tangent, step), C.T @ dmu)


def relative_residual(problem: Problem, at: Evaluation, lambda_a: np.ndarray, tangent: Tangent) -> float:
    """|R with the demanded pressures| over the largest of |f_int|, |H lambda| and the floor."""
    size = max(np.linalg.norm(at.force), np.linalg.norm(at.H @ lambda_a), problem.force_floor)
    parts = np.linalg.norm(at.residual(lambda_a)), np.linalg.norm(problem.pressure_residual(at, tangent))
    return float(sum(parts) / size)


def _admissible(lambda_a: np.ndarray, actuation: Actuation) -> np.ndarray:
    """The multipliers nearest to lambda_a of the form offset + C^T mu."""
    mu = np.linalg.lstsq(actuation.C.T, lambda_a - actuation.offset, rcond=None)[0]
    return actuation.offset + actuation.C.T @ mu


def _closed(problem: Problem, actuation: Actuation, at: Evaluation) -> bool:
    gap = actuation.target - actuation.C @ at.delta_a
    return bool((np.abs(gap) <= 1e-12 * problem.robot.body.mesh.size * np.linalg.norm(actuation.C, axis=1)).all())
