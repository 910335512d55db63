"""The quadratic program of a horizon: commands of the next N ticks, states eliminated (condensing).

With z_0 known and z' = end + A (z - guess) + B (w - guess), w what acts during a tick, every state is affine in the
commands U = (u_1 .. u_N), and

    minimise    sum_k |weights (effectors_k - goal_k)|^2 / 2 + |smooth (u_k - u_(k-1))|^2 / 2
                      + |effort (u_k - rest)|^2 / 2
    subject to  bounds of u_k, |u_k - u_(k-1)| <= rate, bounds of the other half of the actuators' state, and
                normal . effectors_k >= level for each half-space

Where bounds on the robot's motion contradict each other, the plan violates them by the least sum of squares."""

from dataclasses import dataclass

import numpy as np

from cfem.control.search.qp import Backend, QpSolution, QpStatus, solve_qp
from cfem.motion.linear import LinearisedSteps

_SOFT = 1e3  # price of missing a bound on what the robot does, over that of missing a goal by as much


@dataclass(frozen=True)
class HalfSpace:
    """Side of a plane on which the effectors may be: normal (n_e,), level mm: normal . x_e >= level, absolute."""

    normal: np.ndarray
    level: float


@dataclass(frozen=True)
class HorizonCost:
    """Cost of a horizon.

    weights: (n_e,) of the effectors
    smooth: (n_a,) mm per unit of a change of command in a tick
    effort: (n_a,) mm per unit of a command"""

    weights: np.ndarray
    smooth: np.ndarray
    effort: np.ndarray


@dataclass(frozen=True)
class Bounds:
    """Bounds on a horizon.

    command: (n_a, 2)
    rate: (n_a,) largest change a tick
    course: (n_a, 2) of displacements where forces are commanded, of forces where displacements are
    planes: in effectors from rest"""

    command: np.ndarray
    rate: np.ndarray
    course: np.ndarray
    planes: tuple[HalfSpace, ...] = ()


@dataclass(frozen=True)
class Predicted:
    """Prediction that is affine in the commands: value (N, k) + slope (N, k, N n_a) U."""

    value: np.ndarray
    slope: np.ndarray

    def at(self, U: np.ndarray) -> np.ndarray:
        """Values (N, k) under the commands U."""
        return self.value + self.slope @ U


def condensed_states(
    steps: LinearisedSteps,
    z: np.ndarray,
    guess_z: np.ndarray,
    guess_w: np.ndarray,
    last_command: np.ndarray,
    mean: bool,
) -> Predicted:
    """States (N, n_z) after each tick, from z (n_z,) and the command `last_command` (n_a,) that has been reached. mean:
    a tick acts with the mean of the commands at its ends, else with the one at its end; guesses: what `steps` are
    about."""
    n, n_z, n_a = steps.B.shape
    value, slope = np.empty((n, n_z)), np.zeros((n, n_z, n * n_a))
    state, by_u = z, np.zeros((n_z, n * n_a))
    share = 0.5 if mean else 1.0
    for k in range(n):
        B, now = share * steps.B[k], slice(k * n_a, (k + 1) * n_a)
        state = steps.end[k] + steps.A[k] @ (state - guess_z[k]) - steps.B[k] @ guess_w[k]
        by_u = steps.A[k] @ by_u
        by_u[:, now] += B
        if mean and k == 0:
            state = state + B @ last_command
        elif mean:
            by_u[:, now.start - n_a : now.start] += B
        value[k], slope[k] = state, by_u
    return Predicted(value, slope)


def condensed_forces(
    steps: LinearisedSteps, states: Predicted, z: np.ndarray, guess_z: np.ndarray, guess_w: np.ndarray
) -> Predicted:
    """Forces (N, n_a) of actuators whose displacements are commanded, affine in the commands."""
    n, n_a = steps.lam.shape
    before = np.concatenate([z[None], states.value[:-1]])
    by_before = np.concatenate([np.zeros_like(states.slope[:1]), states.slope[:-1]])
    value = steps.lam + np.einsum("kij,kj->ki", steps.lam_by_z, before - guess_z)
    value -= np.einsum("kij,kj->ki", steps.lam_by_u, guess_w)
    slope = steps.lam_by_z @ by_before
    for k in range(n):
        slope[k, :, k * n_a : (k + 1) * n_a] += steps.lam_by_u[k]
    return Predicted(value, slope)


@dataclass(frozen=True)
class HorizonCommands:
    """Commands U (N, n_a) of a horizon. qp: the program's own account; softened: whether bounds on what the robot does
    had to be widened."""

    U: np.ndarray
    qp: QpSolution
    softened: bool


def best_commands(
    effectors: Predicted,
    course: Predicted | None,
    goals: np.ndarray,
    last_command: np.ndarray,
    rest: np.ndarray,
    cost: HorizonCost,
    bounds: Bounds,
    backend: Backend = "active_set",
    begins: np.ndarray | None = None,
) -> HorizonCommands:
    """Commands of a horizon that cost least within their bounds.

    effectors, course: (N, n_e) and (N, n_a) as predicted
    goals: (N, n_e) mm from rest
    last_command: (n_a,) the command before
    rest: (n_a,) what effort is counted from
    begins: (m,) ticks at which the command changes, the first of them 0, None: all"""
    ticks, n_a = len(goals), len(last_command)
    begins = np.arange(ticks) if begins is None else begins
    effectors, course = _held(effectors, begins, n_a), None if course is None else _held(course, begins, n_a)
    lasting = np.diff(np.append(begins, ticks))
    n = len(begins)  # of commands
    D = np.kron(np.eye(n) - np.eye(n, k=-1), np.eye(n_a))
    first = np.zeros(n * n_a)
    first[:n_a] = last_command
    M = [(cost.weights[:, None] * effectors.slope).reshape(-1, n * n_a)[np.tile(cost.weights > 0, ticks)]]
    d = [(cost.weights * (goals - effectors.value)).ravel()[np.tile(cost.weights > 0, ticks)]]
    M.append(np.tile(cost.smooth, n)[:, None] * D)
    d.append(np.tile(cost.smooth, n) * first)
    if cost.effort.any():
        effort = np.outer(np.sqrt(lasting), cost.effort)
        M.append(np.diag(effort.ravel()))
        d.append((effort * rest).ravel())
    M, d = np.concatenate(M), np.concatenate(d)
    hard, soft = _rows(D, first, np.tile(bounds.rate, n), np.tile(bounds.rate, n)), []
    if course is not None:
        low, high = (np.tile(column, ticks) - course.value.ravel() for column in bounds.course.T)
        soft.append(_finite(course.slope.reshape(-1, n * n_a), low, high))
    for plane in bounds.planes:
        level = plane.level - effectors.value @ plane.normal
        soft.append(_finite(plane.normal @ effectors.slope, level, np.full(ticks, np.inf)))
    A, low, high = (np.concatenate(each) for each in zip(hard, *soft, strict=True))
    box = np.tile(bounds.command, (n, 1))
    qp = solve_qp(M, d, A, low, high, box, backend)
    softened = qp.status is QpStatus.INFEASIBLE and len(A) > len(hard[0])
    if softened:
        qp = _softened(M, d, A, low, high, box, len(hard[0]), backend)
    return HorizonCommands(np.repeat(qp.x[: n * n_a].reshape(n, n_a), lasting, axis=0), qp, softened)


def _held(predicted: Predicted, begins: np.ndarray, n_a: int) -> Predicted:
    """Prediction that is affine in the commands of the blocks."""
    if len(begins) == len(predicted.value):
        return predicted
    by_tick = predicted.slope.reshape(*predicted.slope.shape[:2], -1, n_a)
    return Predicted(predicted.value, np.add.reduceat(by_tick, begins, axis=2).reshape(*predicted.slope.shape[:2], -1))


def _rows(D: np.ndarray, centre: np.ndarray, below: np.ndarray, above: np.ndarray) -> tuple[np.ndarray, ...]:
    return _finite(D, centre - below, centre + above)


def _finite(A: np.ndarray, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, ...]:
    bound = np.isfinite(low) | np.isfinite(high)
    return A[bound], low[bound], high[bound]


def _softened(
    M: np.ndarray,
    d: np.ndarray,
    A: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    box: np.ndarray,
    hard: int,
    backend: Backend,
) -> QpSolution:
    """Solution of the program with one more variable for each row after the first `hard`, by which it is missed, at a
    price."""
    n, soft = M.shape[1], len(A) - hard
    missed = np.zeros((len(A), soft))
    missed[hard:] = np.eye(soft)
    price = _SOFT * np.abs(M).max() / np.abs(A[hard:]).max()
    M = np.block([[M, np.zeros((len(M), soft))], [np.zeros((soft, n)), price * np.eye(soft)]])
    open_ = np.tile([-np.inf, np.inf], (soft, 1))
    d, A, box = np.append(d, np.zeros(soft)), np.hstack([A, missed]), np.vstack([box, open_])
    return solve_qp(M, d, A, low, high, box, backend)
