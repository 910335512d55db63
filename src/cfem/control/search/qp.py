"""Small convex quadratic programs, with an answer that can be checked without trusting the solver.

    minimise  |M x - d|^2 / 2    subject to   lower <= A x <= upper,   box[:, 0] <= x <= box[:, 1]

The objective is a least-squares problem, whose condition is the root of that of H = M^T M. Bounds of +-inf are no
bounds. Multipliers are positive where an upper bound holds and negative where a lower one does:
M^T (M x - d) + A^T y + z = 0.

Residuals are lengths in the unit of M x (`qp_program`)."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from math import isfinite
from typing import Literal

import numpy as np

from cfem.control.search.active_set import ActiveSet, least_length
from cfem.control.search.qp_program import TOLERANCE, Kkt, Program, QpAnswer, scaled

Backend = Literal["active_set", "osqp"]
_ROUNDING, _DOUBTFUL = 8e-15, 1e-6  # the same where M is ill-conditioned: times its condition, and at most
_ROUNDED = 1e-13  # a residual that no further round improves
_ROUNDS, _REFINEMENTS = 6, 4


class QpStatus(Enum):
    """How a solve ended; the value is the sentence that the user reads."""

    OPTIMAL = "optimal"
    INFEASIBLE = "the bounds exclude each other"
    INACCURATE = "the solver's answer does not satisfy the optimality conditions"
    NOT_FINITE = "the problem holds numbers that are not finite"


@dataclass(frozen=True)
class QpSolution:
    """Solution of a quadratic program, all in the user's units; NaN where there is none.

    x: (n,)
    y: (m,) multipliers of the rows
    z: (n,) multipliers of the box
    iterations: changes of the active set, or of splitting"""

    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    status: QpStatus
    kkt: Kkt
    iterations: int


def solve_qp(
    M: np.ndarray,
    d: np.ndarray,
    A: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    box: np.ndarray,
    backend: Backend = "active_set",
) -> QpSolution:
    """Minimum of |M x - d|^2 with lower <= A x <= upper and x in its box: M (rows, n), d (rows,), A (m, n), lower and
    upper (m,), box (n, 2).

    `active_set`: exact, refined until only rounding is left. `osqp`: operator splitting with polish, a second opinion
    that costs a hundred times as much. Where M is flat the answer is one of those that are as good."""
    m, n = A.shape
    low, high = np.concatenate([box[:, 0], lower]), np.concatenate([box[:, 1], upper])
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        program, variables, multipliers = scaled(M, d, A, low, high)
        if program is None:
            return _no_answer(m, n, _complaint(M, d, A, low, high), 0)
        answer, iterations = _BACKENDS[backend](program)
        if answer is None:
            return _no_answer(m, n, QpStatus.INFEASIBLE, iterations)
        # The box holds exactly in the user's units too.
        x = np.minimum(np.maximum(answer.x * variables, box[:, 0]), box[:, 1])
        force = answer.multipliers * multipliers
    if not isfinite(x.sum() + force.sum()):
        return _no_answer(m, n, QpStatus.INACCURATE, iterations)
    # Written so that a residual of NaN is inaccurate too.
    accurate = answer.error <= TOLERANCE or answer.error <= min(_DOUBTFUL, _ROUNDING * program.condition)
    accurate = accurate and answer.kkt.feasibility <= TOLERANCE
    status = QpStatus.OPTIMAL if accurate else QpStatus.INACCURATE
    return QpSolution(x, force[n:], force[:n], status, answer.kkt.of(program.unit), iterations)


def _complaint(M: np.ndarray, d: np.ndarray, A: np.ndarray, low: np.ndarray, high: np.ndarray) -> QpStatus:
    """Status of a program that cannot be solved as it stands: what is wrong with it."""
    if not all(np.isfinite(each).all() for each in (M, d, A)) or np.isnan(low).any() or np.isnan(high).any():
        return QpStatus.NOT_FINITE
    closed = (low > high).any() or (low == np.inf).any() or (high == -np.inf).any()
    return QpStatus.INFEASIBLE if closed else QpStatus.INACCURATE  # the latter: numbers too far apart for arithmetic


def _no_answer(m: int, n: int, status: QpStatus, iterations: int) -> QpSolution:
    nothing = Kkt(*[float("nan")] * 3)
    return QpSolution(np.full(n, np.nan), np.full(m, np.nan), np.full(n, np.nan), status, nothing, iterations)


def _active_set(p: Program) -> tuple[QpAnswer | None, int]:
    """Answer of the active set by rounds: each solves for the step from the last answer, with the gradient there and
    bounds from there on. One is enough unless M is flat or nearly so. None where there is no answer, and the changes of
    the active set."""
    none, total = np.zeros(len(p.low)), 0
    x, shadow, best = np.zeros(len(p.S)), p.shadow, None
    low, high = p.low / p.length, p.high / p.length
    for _ in range(_ROUNDS):
        shift = p.normals @ shadow
        active = least_length(p.normals, low - shift, high - shift, np.abs(shift))
        if active is None:
            break
        total += active.changes
        if not active.feasible:
            return None, total
        now = _refined(p, active, x + p.V @ ((shadow + active.y) / p.S))
        slow = best is not None and not now.error < 0.5 * best.error
        best = now if best is None or now.error < best.error else best
        if slow or now.error <= _ROUNDED:
            break
        x, shadow = now.x, -p.gradient(now.x, none)
        values = p.G @ x
        low, high = (p.low - values) / p.length, (p.high - values) / p.length
    return best or p.judged(x, none), total


def _refined(p: Program, active: ActiveSet, x: np.ndarray) -> QpAnswer:
    """x and multipliers on the active constraints, by iterative refinement with the factors at hand."""
    n, which, sign, force = len(x), active.which, active.sign, active.force
    bound, best = np.where(sign > 0, p.low[which], p.high[which]) if len(which) else sign, None
    for _ in range(_REFINEMENTS + 1):
        multipliers = np.zeros(len(p.low))
        if len(which):
            boxed = which < n
            x[which[boxed]] = bound[boxed]
            multipliers[which] = -sign * force / p.length[which]
        now = p.judged(np.minimum(np.maximum(x, p.low[:n]), p.high[:n]), multipliers)
        slow = best is not None and not now.error < 0.5 * best.error
        best = now if best is None or now.error < best.error else best
        if slow or now.error <= _ROUNDED:
            break
        step = -p.gradient(x, multipliers)
        left = sign * (bound - p.G[which] @ x) / p.length[which]
        change = left @ active.T - step @ active.Q
        force = np.maximum(force + active.T @ change, 0.0)
        x = x + p.V @ ((step + active.Q @ change) / p.S)
    return best


def _osqp(p: Program) -> tuple[QpAnswer | None, int]:
    """Answer of OSQP, polished, and its iterations; None where the program has no solution."""
    from contextlib import redirect_stdout
    from io import StringIO

    import osqp
    from scipy.sparse import csc_matrix, triu

    solver = osqp.OSQP()
    solver.setup(
        triu(csc_matrix(p.M.T @ p.M), format="csc"),
        -p.M.T @ p.d,
        csc_matrix(p.G),
        p.low,
        p.high,
        eps_abs=1e-9,
        eps_rel=1e-9,
        scaling=10,
        polishing=True,
        polish_refine_iter=5,
        max_iter=100_000,
        verbose=False,
    )
    with redirect_stdout(StringIO()):  # the polish talks even when told to be quiet
        result = solver.solve(raise_error=False)
    if result.info.status.startswith("primal infeasible"):
        return None, int(result.info.iter)
    n = len(p.S)
    return p.judged(np.clip(result.x, p.low[:n], p.high[:n]), result.y), int(result.info.iter)


_BACKENDS: dict[str, Callable[[Program], tuple[QpAnswer | None, int]]] = {"active_set": _active_set, "osqp": _osqp}
