"""Newton's method on (x, p, mu) for one actuation, reusing each factorisation while it converges.

With A dx = -R + H C^T dmu and C (delta + H^T dx) = target, the border is eliminated: S = C H^T A^-1 H C^T is m x m.
Which one-sided rows hold is found anew in every correction, on S alone (`cfem.equilibrium.complementarity`).
The correction at the new point, by the same factor, is the next chord step for nothing, and its ratio to the one before
says how fast the chord converges (Deuflhard, Newton Methods for Nonlinear Problems, 2004, section 2.1): below `slow`
the factor serves on; above, the tangent is factorised again. What earlier corrections of the same factor have changed
foretells what is left where a few soft motions converge slowly (Anderson, J. ACM 12, 1965).

A fresh tangent takes the stress in its geometric part from the linearisation that led there (solid.stress_lag). Full
steps then converge over large rotations of stiff parts, where a line search would creep: it judges by residuals that
the false strain of a linear step dominates. A step is shortened only where it would invert an element or push walls
through each other; one whose corrections grow is given up, and continuation takes a shorter one."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cfem.equilibrium import complementarity
from cfem.equilibrium.complementarity import NoActiveSetError
from cfem.equilibrium.condensation import ENOUGH
from cfem.equilibrium.system.actuation import Actuation
from cfem.equilibrium.system.evaluation import Evaluation, SolveCost, Tangent
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.solution import State, Status
from cfem.mechanics.factorization import SingularMatrixError
from cfem.mechanics.self_contact import step_until_deep

_EXACT = 1e-13  # of the body's size: positions are no more exact
_NO_GAP = 10 * _EXACT  # likewise: a one-sided row that is beyond its target by less, without a multiplier, holds
_NO_LACK = 100 * _EXACT  # likewise: what a row that does not hold may lack
_REMEMBERED = 5  # corrections of one factor that foretell the next
_NO_PUSH = 1e-9  # of the largest multiplier: what a one-sided row that holds may push


@dataclass(frozen=True)
class NewtonSettings:
    """Settings of Newton's method and of the continuation.

    tolerance:      of the relative residual, where rounding lets it be reached
    max_iterations: of one load step
    slow:           contraction above which the tangent is factorised again (0.4: fewest seconds on the finger)
    max_growth:     fresh corrections in a row that may be larger than the one before
    smallest_step:  fraction of the load reached so far at which continuation gives up
    first_step:     fraction that continuation tries first where the motion is large
    small_motion:   share of the body's size that the linear motion to the whole load may be for continuation to try it
                    at once
    condensed:      relative error of A^-1 H^T, the square of which is that of W"""

    tolerance: float = 1e-10
    max_iterations: int = 30
    slow: float = 0.4
    max_growth: int = 3
    smallest_step: float = 1e-3
    first_step: float = 0.5
    small_motion: float = 0.12
    condensed: float = ENOUGH


@dataclass(frozen=True)
class NewtonResult:
    """Last iterate of a solve, and how it ended.

    at, lam: last iterate
    tangent: the last factored one
    residual: relative, at the last iterate
    rounding: the relative residual that rounding makes
    beyond: negative eigenvalues of A beyond those that the actuation holds, 0 where the equilibrium is stable, by the
    last factor: of a state nearby, so that a doubt wants `judged`
    held: (m,) bool, the rows of the actuation that hold"""

    status: Status
    at: Evaluation
    lam: np.ndarray
    tangent: Tangent | None
    residual: float
    rounding: float
    iterations: int
    held: np.ndarray
    beyond: int = 0

    @property
    def state(self) -> State:
        return State(self.at.x, self.at.pressure, self.lam, self.at.load)


@dataclass(frozen=True)
class _Border:
    """ZC = A^-1 H C^T (n_dof, m) and S = C H^T A^-1 H C^T (m, m) at the factored state."""

    ZC: np.ndarray
    S: np.ndarray

    def negative(self, held: np.ndarray) -> int:
        """Negative eigenvalues of S of the rows held (m,) bool."""
        S = self.S[np.ix_(held, held)]
        return int((np.linalg.eigvalsh((S + S.T) / 2) < 0).sum()) if len(S) else 0


@dataclass(frozen=True)
class Correction:
    """The change that the factor at hand proposes.

    step: (n_dof,) mm
    pressure: (m,) MPa
    multipliers: (n,) N
    held: (m,) bool, the rows of the actuation that hold after it"""

    step: np.ndarray
    pressure: np.ndarray
    multipliers: np.ndarray
    held: np.ndarray

    @property
    def size(self) -> float:
        return float(np.linalg.norm(self.step))

    def less(self, factor: float, other: "Correction") -> "Correction":
        """This correction less a multiple of another."""
        return replace(
            self,
            step=self.step - factor * other.step,
            pressure=self.pressure - factor * other.pressure,
            multipliers=self.multipliers - factor * other.multipliers,
        )


def accelerated(proposed: Correction, taken: Sequence[tuple[Correction, Correction]]) -> Correction:
    """The correction without the part that the changes by earlier ones explain, by least squares of the steps
    (Walker and Ni, SIAM J. Numer. Anal. 49, 2011). taken: those of the same factor, each with the change of what the
    factor proposed that it made."""
    if not taken:
        return proposed
    changes = np.column_stack([change.step for _, change in taken])
    if not (np.isfinite(changes).all() and np.isfinite(proposed.step).all()):
        return proposed
    shares = np.linalg.lstsq(changes, proposed.step, rcond=1e-10)[0]
    for share, (correction, change) in zip(shares, taken, strict=True):
        proposed = proposed.less(share, correction).less(share, change)
    return proposed


def _remembered(
    taken: Sequence[tuple[Correction, Correction]], correction: Correction, proposed: Correction, following: Correction
) -> Sequence[tuple[Correction, Correction]]:
    """The latest corrections, this one among them, with its change from what was proposed to what follows; none where
    other rows hold."""
    if (following.held != correction.held).any():
        return []
    return [*taken, (correction, following.less(1.0, proposed))][-_REMEMBERED:]


def newton(
    problem: Problem,
    start: State,
    actuation: Actuation,
    settings: NewtonSettings,
    cost: SolveCost,
    tangent: Tangent | None = None,
) -> NewtonResult:
    """Solve for `actuation` from `start`, first with `tangent` where one of a state nearby is given. Never raises for
    numerical failure: see `status`."""
    lam = _admissible(start.lam, actuation)
    evaluation = problem.evaluate(problem.kinematics.hold(start.x), start.pressure, actuation.load)
    held = holding(problem, actuation, evaluation, lam)
    smallest = _EXACT * problem.robot.body.mesh.size  # mm a node
    border, residual, rounding, status = None, np.inf, 0.0, Status.TOO_MANY_ITERATIONS
    before, last, growth = None, np.inf, 0
    if tangent is not None:
        try:
            border, correction = _proposed(problem, evaluation, lam, tangent, actuation, held)
            last = correction.size
        except np.linalg.LinAlgError:
            tangent = None
    begin, taken = cost.iterations, []
    for _ in range(settings.max_iterations + 1):
        fresh = tangent is None
        if fresh:
            try:
                tangent, taken = problem.factor(evaluation, start.lam if before is None else lam, cost, before), []
                border, correction = _proposed(problem, evaluation, lam, tangent, actuation, held)
            except (SingularMatrixError, np.linalg.LinAlgError) as error:
                status = Status.UNSTABLE if isinstance(error, NoActiveSetError) else Status.SINGULAR
                tangent = None
                break
            growth, last = growth + 1 if correction.size > last else 0, correction.size
        stalled, residual = residual, problem.relative_residual(evaluation, lam, tangent)
        rounding = problem.rounding(evaluation, lam)
        stalled = residual <= rounding and residual > 0.5 * stalled
        if closed(problem, actuation, evaluation, lam, held) and (residual <= settings.tolerance or stalled):
            status = Status.CONVERGED
            break
        proposed, correction = correction, accelerated(correction, taken)
        trial, part = advanced(problem, evaluation, correction)
        if trial is None and not fresh:
            tangent = None
            continue
        if trial is None or growth >= settings.max_growth or not np.isfinite(correction.size):
            status = Status.STEP_TOO_SMALL
            break
        cost.iterations += 1
        before, evaluation, lam, held = evaluation, trial, lam + part * correction.multipliers, correction.held
        try:
            following = _correct(problem, evaluation, lam, tangent, actuation, border, held)
        except np.linalg.LinAlgError:  # of rows as they are now, and a factor of where they were
            tangent = None
            continue
        if part < 1.0 or following.size > max(settings.slow * proposed.size, smallest):
            tangent = None
        taken, correction = _remembered(taken, correction, proposed, following), following
    beyond = 0 if tangent is None else tangent.factor.negative - border.negative(held)
    return NewtonResult(status, evaluation, lam, tangent, residual, rounding, cost.iterations - begin, held, beyond)


def _proposed(
    problem: Problem, evaluation: Evaluation, lam: np.ndarray, tangent: Tangent, actuation: Actuation, held: np.ndarray
) -> tuple[_Border, Correction]:
    """Border of the actuation at a factored tangent, and the correction that both propose (`_correct`)."""
    border = _border(evaluation, tangent, actuation)
    return border, _correct(problem, evaluation, lam, tangent, actuation, border, held)


def linear_motion(
    problem: Problem, start: State, actuation: Actuation, cost: SolveCost
) -> tuple[float, Tangent | None]:
    """The largest motion of a node in Newton's first correction from `start`, as a share of the body's size, inf where
    there is no correction; and the tangent that made it, None where it is singular."""
    lam, x = _admissible(start.lam, actuation), problem.kinematics.hold(start.x)
    evaluation, tangent = problem.evaluate(x, start.pressure, actuation.load), None
    try:
        tangent = problem.factor(evaluation, start.lam, cost)
        held = holding(problem, actuation, evaluation, lam)
        correction = _proposed(problem, evaluation, lam, tangent, actuation, held)[1]
    except (SingularMatrixError, np.linalg.LinAlgError):
        return np.inf, tangent
    moved = problem.kinematics.spread(x, correction.step)
    return float(np.linalg.norm(moved, axis=1).max() / problem.robot.body.mesh.size), tangent


def judged(problem: Problem, result: NewtonResult, actuation: Actuation, cost: SolveCost) -> NewtonResult:
    """The result with `beyond` of its own state, factorised again where the last factor leaves a doubt."""
    if result.beyond <= 0:
        return result
    try:
        tangent = problem.factor(result.at, result.lam, cost)
        beyond = tangent.factor.negative - _border(result.at, tangent, actuation).negative(result.held)
        return replace(result, tangent=tangent, beyond=beyond)
    except (SingularMatrixError, np.linalg.LinAlgError):
        return replace(result, status=Status.SINGULAR, tangent=None)


def advanced(problem: Problem, evaluation: Evaluation, correction: Correction) -> tuple[Evaluation | None, float]:
    """The state after the step, halved as often as it inverts an element and shortened where it would push walls
    through each other, and the part taken; None where it cannot."""
    for halvings in range(6):
        part = 0.5**halvings
        trial = _after(problem, evaluation, correction, part)
        if trial.response.min_J > 0.0:
            break
    else:
        return None, 0.0
    contact, walls = evaluation.response.contact, problem.body.contact
    until = 1.0 if contact is None else step_until_deep(walls, contact.gap, trial.response.contact.gap)
    shorter = trial if until == 1.0 else _after(problem, evaluation, correction, until * part)
    return (shorter, until * part) if shorter.response.min_J > 0.0 else (trial, part)


def _after(problem: Problem, evaluation: Evaluation, correction: Correction, part: float) -> Evaluation:
    """The state after a part of the step."""
    x = problem.kinematics.advance(evaluation.x, part * correction.step)
    return problem.evaluate(x, evaluation.pressure + part * correction.pressure, evaluation.load)


def holding(problem: Problem, actuation: Actuation, evaluation: Evaluation, lam: np.ndarray) -> np.ndarray:
    """Mask (m,) of the rows that hold at a state: all but one-sided ones without a multiplier beyond their targets."""
    gap = actuation.C @ evaluation.delta - actuation.target
    return ~actuation.unilateral | (actuation.C @ lam > 0) | (gap <= _NO_GAP * _move(problem, actuation, evaluation))


def closed(problem: Problem, actuation: Actuation, evaluation: Evaluation, lam: np.ndarray, held: np.ndarray) -> bool:
    """True where C delta is what it should be, to the rounding of positions: no one-sided row pushes, and none that
    does not hold, (m,) bool of all, lacks anything or carries a multiplier."""
    gap, exact = actuation.C @ evaluation.delta - actuation.target, _move(problem, actuation, evaluation)
    mu, push = actuation.C @ lam, _NO_PUSH * max(float(np.abs(lam).max(initial=0.0)), problem.force_floor)
    holds = (np.abs(gap) <= _EXACT * exact) & ~(actuation.unilateral & (mu < -push))
    loose = (gap >= -_NO_LACK * exact) & (mu == 0)
    return bool(np.where(held, holds, loose).all())


def _move(problem: Problem, actuation: Actuation, evaluation: Evaluation) -> np.ndarray:
    """Largest change (m,) mm of C delta where every node moves by the size of the body."""
    return problem.robot.body.mesh.size * (np.abs(actuation.C) @ np.abs(evaluation.H).sum(axis=0))


def _border(evaluation: Evaluation, tangent: Tangent, actuation: Actuation) -> _Border:
    HC = evaluation.H @ actuation.C.T
    ZC = tangent.factor.solve(HC) if len(actuation.C) else HC
    return _Border(ZC, HC.T @ ZC)


def _correct(
    problem: Problem,
    evaluation: Evaluation,
    lam: np.ndarray,
    tangent: Tangent,
    actuation: Actuation,
    border: _Border,
    held: np.ndarray,
) -> Correction:
    """The (chord) Newton correction at `evaluation` with the factor of `tangent`, to which `border` belongs; held (m,)
    bool: the rows that hold there. Raises LinAlgError where rows that hold depend on each other, NoActiveSetError."""
    C = actuation.C
    imbalance = evaluation.residual(lam) + problem.pressure_residual(evaluation, tangent)
    free = -tangent.factor.solve(imbalance[:, None])[:, 0]
    dmu = np.zeros(0)
    if len(C):
        gap = C @ (evaluation.delta + evaluation.H.T @ free) - actuation.target
        S, none = C @ evaluation.H.T @ border.ZC, _NO_GAP * _move(problem, actuation, evaluation)
        dmu, held = complementarity.change(S, gap, C @ lam, actuation.unilateral, held, none)
    step = free + border.ZC @ dmu
    return Correction(step, problem.pressure_step(evaluation, tangent, step), C.T @ dmu, held)


def _admissible(lam: np.ndarray, actuation: Actuation) -> np.ndarray:
    """The multipliers nearest to lam of the form offset + C^T mu, in which no one-sided row pushes."""
    mu = np.linalg.lstsq(actuation.C.T, lam - actuation.offset, rcond=None)[0]
    unilateral = actuation.unilateral
    mu[unilateral] = np.maximum((actuation.C @ lam)[unilateral], 0.0)
    return actuation.offset + actuation.C.T @ mu
