"""Equilibria that are tried, and what of them can be measured without trusting the solver.

The derivative of the residual along the responses q that the answer holds, by central differences, says whether W is
what it claims to be: with H the gradients of the rows, A q_j = H_j and W_ij = H_i . q_j, so W_ij = q_i . (A q_j)."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import Actuation
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.robot import Robot
from cfem.equilibrium.system.solution import Equilibrium, State
from cfem.mechanics.assembly import symmetric_product
from cfem.mechanics.body import response
from cfem.stability.evidence import Evidence, LimitCheck
from cfem.stability.recompute import force_scale, forces, gradients, motion, strayed

_DENSE = 2500  # unknowns up to which stability is judged again by dense matrices
_STEP = 1e-5  # of the size of the body: of differences


@dataclass(frozen=True)
class Trial:
    """A solve that was tried. slack: whether unilateral actuators could go slack."""

    robot: Robot
    actuation: Actuation
    slack: bool
    answer: Equilibrium

    def evidence(self) -> Evidence:
        return examine(self)


def attempt(
    make: Callable[[], Robot],
    actuation: Actuation | Callable[[Robot], Actuation],
    slack: bool = True,
    start: Callable[[Robot], State] | None = None,
) -> Callable[[], Trial]:
    """Builds the robot and solves, from rest unless `start` says otherwise."""

    def work() -> Trial:
        robot = make()
        wanted = actuation(robot) if callable(actuation) else actuation
        answer = solve(Problem(robot), wanted, start=start(robot) if start else None, slack=slack)
        return Trial(robot, wanted.padded(len(answer.delta)), slack, answer)

    return work


def examine(trial: Trial) -> Evidence:
    """Evidence of an equilibrium: checks of state, actuation, compliance and stability where an answer is claimed."""
    answer = trial.answer
    begin = Evidence(
        answer.status.name,
        answer.converged,
        (_finite(answer),),
        tolerance=answer.tolerance,
        rounding=answer.rounding,
        iterations=answer.iterations,
        factorizations=answer.factorizations,
    )
    if not (answer.converged and begin.checks[0].passed):
        return begin
    W = answer.condensed.W
    eigenvalues = np.linalg.eigvalsh(_unit_diagonal(W))
    size = np.abs(eigenvalues)
    residual, *state = _state_checks(trial)
    asymmetry, *compliance = _compliance_checks(trial)
    return replace(
        begin,
        checks=(*begin.checks, residual, *state, *_actuation_checks(trial), asymmetry, *compliance, _stability(trial)),
        residual=residual.value,
        asymmetry=asymmetry.value,
        smallest_eigenvalue=float(eigenvalues[0]),
        condition=float(size.max() / size.min()) if size.min() > 0 else np.inf,
    )


def _finite(answer: Equilibrium) -> LimitCheck:
    state, condensed = answer.state, answer.condensed
    parts = [state.x, state.pressure, state.lam, answer.delta, answer.delta_e, answer.energy, answer.residual]
    if condensed is not None:
        parts += [condensed.W, condensed.delta_free, condensed.lam, answer.response]
    return LimitCheck("numbers that are not finite", float(sum((~np.isfinite(part)).sum() for part in parts)), 0)


def _state_checks(trial: Trial) -> list[LimitCheck]:
    """Checks of the state: residual, stated rounding, inverted elements, held and rigid nodes."""
    robot, answer = trial.robot, trial.answer
    x, lam = answer.state.x, answer.state.lam
    balance = forces(robot, x, lam, trial.actuation.load)
    scale = force_scale(robot, balance)
    digit = np.finfo(float).eps * np.abs(x).max() * np.random.default_rng(0).uniform(-1, 1, x.shape)
    digit[robot.fixed] = 0.0
    noise = np.linalg.norm(forces(robot, x + digit, lam, trial.actuation.load).residual - balance.residual) / scale
    return [
        LimitCheck("residual, recomputed", float(np.linalg.norm(balance.residual) / scale), max(1e-8, answer.rounding)),
        LimitCheck("stated rounding level", answer.rounding, max(1e-8, 100 * float(noise))),
        LimitCheck("elements inverted", float(not response(robot.body, x).min_J > 0), 0),
        LimitCheck("motion of held nodes or within rigid bodies", strayed(robot, x), 1e-11),
    ]


def _actuation_checks(trial: Trial) -> list[LimitCheck]:
    """Checks of the actuation: prescribed displacements and forces, and that no cable pushes."""
    robot, actuation, lam = trial.robot, trial.actuation, trial.answer.state.lam
    gap, loose = _gaps(trial), _slack_rows(trial)
    largest = float(np.abs(lam).max(initial=0.0)) or 1.0
    pulls = np.zeros(len(lam), dtype=bool)
    pulls[: robot.rows.n_a] = robot.unilateral & trial.slack
    free = lam - np.where(pulls, np.maximum(actuation.offset, 0), actuation.offset)  # asked to push, it is slack
    held = actuation.C[~loose]
    mu = np.linalg.lstsq(held.T, free, rcond=None)[0]
    push = -lam[: robot.rows.n_a][robot.unilateral].min(initial=0.0) if trial.slack else 0.0
    return [
        LimitCheck("prescribed displacement missed", float(np.where(loose, gap, np.abs(gap)).max(initial=0.0)), 1e-9),
        LimitCheck("prescribed force missed", float(np.abs(free - held.T @ mu).max(initial=0.0) / largest), 1e-9),
        LimitCheck("push of a cable, over the largest force", float(push / largest), 1e-9),
    ]


def _gaps(trial: Trial) -> np.ndarray:
    """Residuals (m,) of the prescribed displacements, relative to those of a motion of the whole body by its size."""
    robot, C = trial.robot, trial.actuation.C
    per_node = np.abs(gradients(robot, robot.active, trial.answer.state.x)).sum(axis=0)
    scale = np.abs(C) @ per_node * robot.body.mesh.size
    return (trial.actuation.target - C @ _delta(trial)) / np.maximum(scale, np.finfo(float).tiny)


def _slack_rows(trial: Trial) -> np.ndarray:
    """Mask (m,) of the rows that prescribe one cable that carries nothing, and may be shorter than prescribed."""
    robot, lam = trial.robot, trial.answer.state.lam
    n_a = robot.rows.n_a
    slack = np.zeros(len(lam), dtype=bool)
    slack[:n_a] = robot.unilateral & trial.slack & (np.abs(lam[:n_a]) <= 1e-9 * np.abs(lam).max(initial=0.0))
    return np.array([np.count_nonzero(row) == 1 and slack[row != 0].any() for row in trial.actuation.C], dtype=bool)


def _compliance_checks(trial: Trial) -> list[LimitCheck]:
    """Checks of W: symmetry, and W = H^T q with q the response of the nodes, whose stiffness is differenced from the
    residual."""
    robot, answer, condensed = trial.robot, trial.answer, trial.answer.condensed
    x, lam, W, rows = answer.state.x, answer.state.lam, condensed.W, condensed.rows
    H = np.hstack([gradients(robot, robot.effectors, x), gradients(robot, robot.active, x)])
    q = np.stack([motion(robot, x, column) for column in np.moveaxis(answer.response, 2, 0)], axis=1)
    slopes = np.stack([_slope(trial, column) for column in np.moveaxis(answer.response, 2, 0)], axis=1)
    raw = H.T @ q
    active_block, raw_active = W[rows.active, rows.active], raw[rows.active]
    full_delta = np.concatenate([*(row.value(x) - row.rest for row in robot.effectors), _delta(trial)])
    apart = full_delta - (W[:, rows.active] @ lam + condensed.delta_free)
    return [
        LimitCheck("asymmetry of W", _relative(raw_active - raw_active.T, active_block), 1e-5),
        LimitCheck("asymmetry of W as given", _relative(W - W.T, W), 1e-14),
        LimitCheck("W against H^T q", _relative(raw - W[:, rows.active], W[:, rows.active]), 1e-5),
        LimitCheck(
            "W against differences of the residual",
            _relative(q.T @ slopes - active_block, active_block),
            1e-4 + 10 * answer.rounding,
        ),
        LimitCheck("delta against W lambda + delta_free", float(np.abs(apart).max() / robot.body.mesh.size), 1e-9),
    ]


def _slope(trial: Trial, along: np.ndarray) -> np.ndarray:
    """Derivative (n_dof,) N/mm of the residual along a motion (n, 3), by central differences of fourth order."""
    robot, answer = trial.robot, trial.answer
    x, lam = answer.state.x, answer.state.lam
    h = _STEP * robot.body.mesh.size / max(float(np.abs(along).max()), 1e-300)
    up2, up, down, down2 = (
        forces(robot, x + k * h * along, lam, trial.actuation.load).residual for k in (2, 1, -1, -2)
    )
    return (8 * (up - down) - (up2 - down2)) / (12 * h)


def _stability(trial: Trial) -> LimitCheck:
    """Directions of negative energy that the held rows leave: negative eigenvalues of the tangent less those of the
    compliance of these rows (Haynsworth, Linear Algebra Appl. 1, 1968), by dense matrices."""
    robot, answer = trial.robot, trial.answer
    problem, lam = Problem(robot), answer.state.lam
    n = problem.pattern.n_dof
    what = "directions in which the equilibrium is unstable"
    if n > _DENSE:
        return LimitCheck(what + " (body too large to tell)", 0, 0)
    evaluation = problem.evaluate(answer.state.x, np.empty(0), trial.actuation.load)
    A = symmetric_product(problem.pattern, problem.stiffness(evaluation, lam)[0], np.eye(n))
    scale = 1 / np.sqrt(np.abs(np.diag(A)))
    A *= scale[:, None] * scale
    try:
        np.linalg.cholesky(A)
    except np.linalg.LinAlgError:
        C, act = trial.actuation.C[~_slack_rows(trial)], answer.condensed.rows.active
        held = C @ answer.condensed.W[act, act] @ C.T
        beyond = (np.linalg.eigvalsh(A) < 0).sum() - (np.linalg.eigvalsh(held) < 0).sum()
        return LimitCheck(what, float(beyond), 0)
    return LimitCheck(what, 0, 0)


def _delta(trial: Trial) -> np.ndarray:
    """Displacements (n_a + n_c,) of the active rows, from the positions alone."""
    x = trial.answer.state.x
    return np.concatenate([np.zeros(0), *(row.value(x) - row.rest for row in trial.robot.active)])


def _unit_diagonal(W: np.ndarray) -> np.ndarray:
    """W without rows that are zero (a held effector's), scaled to +-1 on its diagonal."""
    kept = np.abs(W).max(axis=1) > 0
    W = W[kept][:, kept]
    scale = np.sqrt(np.maximum(np.abs(np.diag(W)), 1e-300))
    return W / np.outer(scale, scale)


def _relative(error: np.ndarray, reference: np.ndarray) -> float:
    """Largest entry, over the largest of `reference`; rows may differ in their units only by a factor that W keeps."""
    return float(np.abs(error).max(initial=0.0) / max(float(np.abs(reference).max(initial=0.0)), 1e-300))
