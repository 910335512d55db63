"""From an actuation to an equilibrium: directly where a good start is given, else by adaptive continuation.

Continuation leads the actuation from that of an equilibrium to the one asked for, halving a load step that fails and
doubling one that went easily. A cable that would have to push is let slack, and pulled again where it would tighten."""

import time
from dataclasses import replace

import numpy as np

from cfem.equilibrium.actuation import Actuation
from cfem.equilibrium.condensation import condense as condensation
from cfem.equilibrium.newton import NewtonResult, Settings, newton
from cfem.equilibrium.problem import Cost, Problem
from cfem.equilibrium.solution import Equilibrium, State, Status
from cfem.mechanics.factorization import SingularMatrixError
from cfem.mechanics.solid import response

DEFAULT = Settings()


def rest_state(problem: Problem) -> State:
    """The undeformed robot, unloaded."""
    return State(problem.rest, np.zeros(problem.robot.body.n_pressures), np.zeros(problem.robot.rows.n_a))


def solve(
    problem: Problem,
    actuation: Actuation,
    start: State | None = None,
    base: State | None = None,
    settings: Settings = DEFAULT,
    condense: bool = True,
    slack: bool = True,
) -> Equilibrium:
    """Equilibrium under `actuation`: by Newton's method from `start` where one is given; failing that by continuation
    from the equilibrium `base`; failing that from rest.

    slack: let unilateral actuators go slack rather than push. condense: also W and delta_free.
    Never raises for numerical failure: `status` says how it ended and the state is the last one reached."""
    begin, cost = time.perf_counter(), Cost()
    taut = np.ones(len(actuation.C), dtype=bool)
    allowed = 4 * len(actuation.C) if slack else 0
    result = _reach(problem, actuation, start, base, settings, cost)
    while result.status is Status.CONVERGED and allowed > 0:
        change = _change_of_slack(problem, actuation, taut, result)
        if change is None:
            break
        taut[change] = not taut[change]
        allowed -= 1
        result = _reach(problem, _only(actuation, taut), result.state, result.state, settings, cost)
    return _answer(problem, result, actuation.C[taut], cost, begin, condense)


def _reach(
    problem: Problem,
    actuation: Actuation,
    start: State | None,
    base: State | None,
    settings: Settings,
    cost: Cost,
) -> NewtonResult:
    """Directly from the start, else by continuation from the base, else from rest."""
    if not all(_finite(actuation, state) for state in (start, base)):
        at = problem.evaluate(problem.rest, np.empty(0))
        return NewtonResult(Status.NOT_FINITE, at, np.zeros(actuation.n_a), None, np.inf, 0)
    if start is not None:
        cost.steps += 1
        result = newton(problem, start, actuation, settings, cost)
        if result.status is Status.CONVERGED:
            return result
    if base is not None:
        result = _continuation(problem, actuation, base, settings, cost)
        if result.status is Status.CONVERGED:
            return result
    return _continuation(problem, actuation, rest_state(problem), settings, cost)


def _continuation(problem: Problem, actuation: Actuation, start: State, settings: Settings, cost: Cost) -> NewtonResult:
    C = actuation.C
    first = np.array([actuator.value(start.x)[0] for actuator in problem.robot.actuators])
    mu = np.linalg.lstsq(C.T, start.lambda_a, rcond=None)[0]
    offset = start.lambda_a - C.T @ mu
    done, step, state = 0.0, settings.first_step, start
    while True:
        to = min(1.0, done + step)
        cost.steps += 1
        part = Actuation(C, (1 - to) * (C @ first) + to * actuation.target, (1 - to) * offset + to * actuation.offset)
        # loose on the way: only the last step has to be exact
        tuned = settings if to == 1.0 else replace(settings, tolerance=max(1e-4, settings.tolerance))
        result = newton(problem, state, part, tuned, cost)
        if result.status is Status.CONVERGED:
            if to == 1.0:
                return result
            done, state = to, result.state
            step *= 2.0 if result.iterations <= 5 else 1.0
        else:
            step = (to - done) / 2
            if step < settings.smallest_step:
                return result


def _change_of_slack(problem: Problem, actuation: Actuation, taut: np.ndarray, result: NewtonResult) -> int | None:
    """The prescribed row to let go (it pushes) or to take up (its path has become too long), None where all is well."""
    rows = [np.flatnonzero(row) for row in actuation.C]
    tension = np.zeros(len(rows))
    lack = np.zeros(len(rows))
    for index, row in enumerate(rows):
        if len(row) == 1 and problem.robot.unilateral[row[0]]:
            if taut[index]:
                tension[index] = result.lambda_a[row[0]]
            else:
                lack[index] = actuation.target[index] - actuation.C[index] @ result.at.delta_a
    if len(rows) and tension.min() < -1e-9 * max(np.abs(result.lambda_a).max(), problem.force_floor):
        return int(tension.argmin())
    if len(rows) and lack.max() > 1e-9 * problem.robot.body.mesh.size:
        return int(lack.argmax())
    return None


def _only(actuation: Actuation, taut: np.ndarray) -> Actuation:
    return Actuation(actuation.C[taut], actuation.target[taut], actuation.offset)


def _finite(actuation: Actuation, start: State | None) -> bool:
    arrays = [actuation.C, actuation.target, actuation.offset]
    arrays += [start.x, start.pressure, start.lambda_a] if start is not None else []
    return all(np.isfinite(array).all() for array in arrays)


def _answer(
    problem: Problem, result: NewtonResult, held: np.ndarray, cost: Cost, begin: float, condense: bool
) -> Equilibrium:
    """held (m, n_a): rows of C that the actuation ended with."""
    status, robot, x = result.status, problem.robot, result.at.x
    condensed, response_a = None, None
    if status is Status.CONVERGED and condense:
        try:
            condensed, response_a, factor = condensation(problem, result.at, result.lambda_a, result.tangent, cost)
            # stable with those rows held if A has no more negative eigenvalues than C W_aa C^T (Haynsworth's inertia)
            if factor.negative > (np.linalg.eigvalsh(held @ condensed.W_aa @ held.T) < 0).sum():
                status = Status.UNSTABLE
        except SingularMatrixError:
            status = Status.SINGULAR
    settled = response(robot.body, x)
    imbalance = settled.force[problem.pattern.free].ravel() - result.at.H @ result.lambda_a
    scale = max(
        np.linalg.norm(settled.force[problem.pattern.free]),
        np.linalg.norm(result.at.H @ result.lambda_a),
        problem.force_floor,
    )
    slack = robot.unilateral & (
        np.abs(result.lambda_a) <= 1e-9 * max(np.abs(result.lambda_a).max(initial=0.0), problem.force_floor)
    )
    return Equilibrium(
        status=status,
        state=result.state,
        delta_a=result.at.delta_a,
        delta_e=np.concatenate([effector.value(x) - effector.rest for effector in robot.effectors]),
        slack=slack,
        energy=settled.energy,
        residual=float(np.linalg.norm(imbalance) / scale),
        iterations=cost.iterations,
        factorizations=cost.factorizations,
        steps=cost.steps,
        seconds=time.perf_counter() - begin,
        condensed=condensed,
        dx_dlambda=response_a,
    )
