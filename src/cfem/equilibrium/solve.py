"""Equilibrium under an actuation: directly where a good start is given, else by adaptive continuation.

Continuation leads the actuation from that of an equilibrium to the one asked for, halving a load step that fails and
doubling one that went easily. The first step is the whole way where the tangent at the start predicts a small motion:
a state in between costs as much as the last one. Continuation watches the inertia of the tangent: where a path loses
its stability, or ends, the status says of which kind the critical point is. A cable that is told its length does not
push anywhere on the way: Newton's method finds which ones are slack."""

import time
from dataclasses import dataclass, replace

import numpy as np

from cfem.equilibrium.criticality import classify, softest_mode
from cfem.equilibrium.derived import W_ALONE, Derived, Wanted, derive
from cfem.equilibrium.newton import NewtonResult, NewtonSettings, judged, linear_motion, newton
from cfem.equilibrium.system.actuation import Actuation, pulling_only
from cfem.equilibrium.system.evaluation import SolveCost, Tangent
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.robot import demand_without_friction, watched_displacements
from cfem.equilibrium.system.solution import Equilibrium, State, Status
from cfem.mechanics.factorization import SingularMatrixError

DEFAULT = NewtonSettings()
# Share of the way that is not worth a step, however far the way leads.
_NOTHING = 1e-12
# Times the tolerance that a residual may have come to when the pressures follow the positions.
_SLIGHTLY = 1.5


def rest_state(problem: Problem) -> State:
    """The undeformed robot, no load on it."""
    load = 1.0 if problem.loads is None else 0.0
    return State(problem.rest, np.zeros(problem.body.n_pressures), np.zeros(problem.n_active), load)


def solve(
    problem: Problem,
    actuation: Actuation,
    start: State | None = None,
    base: State | None = None,
    settings: NewtonSettings = DEFAULT,
    slack: bool = True,
    tangent: Tangent | None = None,
    wanted: Wanted = W_ALONE,
    cost: SolveCost | None = None,
) -> Equilibrium:
    """Equilibrium under `actuation`: by Newton's method from `start` where one is given; failing that by continuation
    from the equilibrium `base`; failing that from rest. An actuation or a start of the actuators alone leaves contacts
    free.

    slack: let unilateral actuators go slack rather than push
    tangent: of a state near the start, with which Newton's method begins
    wanted: what is asked of the state beside itself
    cost: counts the work, for who watches while the solve goes on

    Never raises for numerical failure: `status` says how it ended and the state is the last one reached."""
    demand_without_friction(problem.robot)
    begin, cost = time.perf_counter(), cost or SolveCost()
    actuation = actuation.padded(problem.n_active)
    if start is not None:
        start = replace(start, lam=np.pad(start.lam, (0, problem.n_active - len(start.lam))))
    if not _finite(problem, actuation, start, base):
        return _answer(problem, _not_finite(problem, actuation), actuation, settings, cost, begin, wanted)
    if slack:
        actuation = pulling_only(actuation, problem.robot.unilateral)
    path = _reach(problem, actuation, start, base, settings, cost, tangent)
    return _answer(problem, path, actuation, settings, cost, begin, wanted)


@dataclass(frozen=True)
class _Path:
    """A followed load path.

    result: of the last Newton solve
    lost: (stable, unstable) shares of the way between which stability was lost, None where it never was
    stable: the last converged result on the way, a stable one where there was any
    share: reached"""

    result: NewtonResult
    lost: tuple[float, float] | None = None
    stable: NewtonResult | None = None
    share: float = 1.0


def _reach(
    problem: Problem,
    actuation: Actuation,
    start: State | None,
    base: State | None,
    settings: NewtonSettings,
    cost: SolveCost,
    tangent: Tangent | None = None,
) -> _Path:
    """Solution by Newton's method from the start, else by continuation from the base, else from rest."""
    if start is not None:
        cost.steps += 1
        result = newton(problem, start, actuation, settings, cost, tangent)
        if result.status is Status.CONVERGED:
            result = judged(problem, result, actuation, cost)
            if result.status is Status.CONVERGED and result.beyond <= 0:
                return _Path(result)
    if base is not None:
        path = _continuation(problem, actuation, base, settings, cost)
        if path.result.status is Status.CONVERGED and path.lost is None:
            return path
    return _continuation(problem, actuation, rest_state(problem), settings, cost)


def _continuation(
    problem: Problem, actuation: Actuation, start: State, settings: NewtonSettings, cost: SolveCost
) -> _Path:
    """Follows the actuation from `start` in steps that double where Newton's method is quick, and halve where it
    fails."""
    C = actuation.C
    first = np.concatenate([np.empty(0), *(row.value(start.x) - row.rest for row in problem.robot.active)])
    mu = np.linalg.lstsq(C.T, start.lam, rcond=None)[0]
    offset = start.lam - C.T @ mu
    offset[C[actuation.unilateral].any(axis=0)] = 0.0  # without rounding: a slack cable carries nothing
    done, state, failed = 0.0, start, False
    motion, tangent = linear_motion(problem, start, actuation, cost)
    step = 1.0 if motion <= settings.small_motion else settings.first_step
    lost, stable, reached = None, None, None

    def part(to: float) -> Actuation:
        return replace(
            actuation,
            target=(1 - to) * (C @ first) + to * actuation.target,
            offset=(1 - to) * offset + to * actuation.offset,
            load=(1 - to) * start.load + to * actuation.load,
        )

    while True:
        to = min(1.0, done + step)
        cost.steps += 1
        # loose on the way: only the last step has to be exact
        tuned = settings if to == 1.0 else replace(settings, tolerance=max(1e-4, settings.tolerance))
        result, tangent = newton(problem, state, part(to), tuned, cost, tangent), None
        if result.status is Status.CONVERGED:
            result = judged(problem, result, part(to), cost)
        if result.status is Status.CONVERGED:
            if lost is None and result.beyond > 0:
                lost = (done, to)
            stable = result if lost is None else stable
            reached = result
            if to == 1.0:
                return _Path(result, lost, stable)
            done, state = to, result.state
            step *= 2.0 if result.iterations <= 5 and not failed else 1.0
            failed = False
        else:
            step, failed = (to - done) / 2, True
            cost.halvings += 1
            if step < max(settings.smallest_step * done, _NOTHING):
                return _Path(result, lost, stable or reached, done)


def _finite(problem: Problem, actuation: Actuation, *states: State | None) -> bool:
    arrays = [actuation.C, actuation.target, actuation.offset, np.array(actuation.load)]
    for state in states:
        arrays += [] if state is None else [state.x, state.pressure, state.lam, np.array(state.load)]
    return problem.finite and all(np.isfinite(array).all() for array in arrays)


def _not_finite(problem: Problem, actuation: Actuation) -> _Path:
    evaluation = problem.evaluate(problem.rest, np.empty(0), 0.0)
    held = np.ones(len(actuation.C), dtype=bool)
    return _Path(NewtonResult(Status.NOT_FINITE, evaluation, np.zeros(actuation.n), None, np.inf, 0.0, 0, held))


def _answer(
    problem: Problem,
    path: _Path,
    actuation: Actuation,
    settings: NewtonSettings,
    cost: SolveCost,
    begin: float,
    wanted: Wanted,
) -> Equilibrium:
    """Equilibrium from the end of a path: what is derived from it, its residual at the pressures that x demands, its
    status."""
    result, robot, x = path.result, problem.robot, path.result.at.x
    status, derived = result.status, Derived()
    if status is Status.CONVERGED and wanted.condense:
        try:
            derived, stable = derive(problem, result, actuation.only(result.held), wanted, settings.condensed, cost)
            status = status if stable else Status.UNSTABLE
        except SingularMatrixError:
            status = Status.SINGULAR
    elif status is Status.CONVERGED and result.beyond > 0:
        status = Status.UNSTABLE
    if status not in (Status.CONVERGED, Status.NOT_FINITE):
        status = _cause(problem, path, actuation, status, cost)
    settled = problem.evaluate(x, np.empty(0), result.at.load)  # with the pressures that x itself demands
    residual, tolerance = problem.relative_residual(settled, result.lam), max(settings.tolerance, result.rounding)
    if status is Status.CONVERGED and not residual <= _SLIGHTLY * tolerance:
        status, derived = Status.INACCURATE, Derived()
    n_a = robot.rows.n_a
    largest, watched = np.abs(result.lam).max(initial=0.0), watched_displacements(robot, x)
    if robot.discrepancy is not None:
        watched[robot.discrepancy.numbers(robot.rows.effectors)] += robot.discrepancy.value(result.lam[:n_a])
    nothing = max(1e-9, result.rounding) * max(largest, problem.force_floor)  # near rest, forces are rounding
    slack = robot.unilateral & (np.abs(result.lam[:n_a]) <= nothing)
    return Equilibrium(
        status=status,
        state=result.state,
        n_a=n_a,
        delta=result.at.delta,
        delta_e=watched[: robot.rows.n_e],
        slack=slack,
        energy=problem.potential(settled),
        residual=residual,
        rounding=result.rounding,
        tolerance=tolerance,
        path=path.share if path.lost is None else path.lost[1],
        iterations=cost.iterations,
        factorizations=cost.factorizations,
        steps=cost.steps,
        seconds=time.perf_counter() - begin,
        delta_s=watched[robot.rows.n_e :],
        **vars(derived),
    )


def _cause(problem: Problem, path: _Path, actuation: Actuation, status: Status, cost: SolveCost) -> Status:
    """Cause of the path's end: a body that is not held even at rest; a critical point, by the softest mode of the last
    stable state against that at rest; else the end of what can be reached."""
    try:
        evaluation, none = problem.evaluate(problem.rest, np.empty(0), 0.0), np.zeros(actuation.n)
        held = np.ones(len(actuation.C), dtype=bool)
        rest = NewtonResult(
            Status.CONVERGED, evaluation, none, problem.factor(evaluation, none, cost), 0.0, 0.0, 0, held
        )
        stiffness = softest_mode(problem, rest, actuation)[0]
        near = path.stable
        if near is None or near.tangent is None:
            return status
        fresh = replace(near, tangent=problem.factor(near.at, near.lam, cost))
    except (SingularMatrixError, np.linalg.LinAlgError):
        return Status.SINGULAR
    cause = classify(problem, fresh, actuation.only(near.held), stiffness)
    if cause is not None:
        return cause
    # Newton's method leaves the stable states that it steps from: only a path that lost its stability ends unstable.
    passed = path.result.status is Status.CONVERGED or path.lost is not None
    return status if status is Status.UNSTABLE and passed else Status.OUT_OF_REACH
