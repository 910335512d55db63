"""Small convex quadratic programs, with an answer that can be checked without trusting the solver.

    minimise  |M x - d|^2 / 2    subject to   lower <= A x <= upper,   box[:, 0] <= x <= box[:, 1]

The objective is a least-squares problem, whose condition is the root of that of H = M^T M. Bounds of +-inf are no
bounds. Multipliers are positive where an upper bound holds and negative where a lower one does:
M^T (M x - d) + A^T y + z = 0.

The coordinates are those of the objective, S V^T x with M = U S V^T, and residuals are lengths in them, in the unit of
M x: mm for an inverse step. The units of the variables and the widths of their bounds have no part in either."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from math import sqrt
from typing import Literal

import numpy as np

from cfem.control.active_set import ActiveSet, least_length

Backend = Literal["active_set", "osqp"]
TOLERANCE = 1e-9  # largest residual of a solved program, relative to d and M x and to the terms of a bound
_ROUNDING, _DOUBTFUL = 8e-15, 1e-6  # the same where M is ill-conditioned: times its condition, and at most
_ROUNDED = 1e-13  # a residual that no further round improves
_FLAT, _HELD = 1e-13, 1e-5  # singular values: below the first M is flat, and gets the second about the last answer
_ROUNDS, _REFINEMENTS = 6, 4


class QpStatus(Enum):
    """How a solve ended; the value is the sentence that the user reads."""

    OPTIMAL = "optimal"
    INFEASIBLE = "the bounds exclude each other"
    INACCURATE = "the solver's answer does not satisfy the optimality conditions"
    NOT_FINITE = "the problem holds numbers that are not finite"


@dataclass(frozen=True)
class Kkt:
    """Residuals of the optimality conditions, recomputed from x and the multipliers alone.

    stationarity: in the unit of M x, what M x would have to move by for the forces to balance
    complementarity: in the unit of M x, of each multiplier the smaller of its force and the distance from its bound
    feasibility: largest violation of a bound, relative to the bound and to the terms of the row"""

    stationarity: float
    complementarity: float
    feasibility: float

    def of(self, unit: float) -> "Kkt":
        """In a unit of M x that is `unit` times smaller."""
        return Kkt(self.stationarity * unit, self.complementarity * unit, self.feasibility)

    @property
    def missed(self) -> float:
        """How far M x is from the optimum, to first order."""
        return max(self.stationarity, self.complementarity)


@dataclass(frozen=True)
class QpSolution:
    """x (n,), y (m,) multipliers of the rows, z (n,) of the box, all in the user's units; NaN where there is
    no answer. iterations: changes of the active set, or of splitting."""

    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    status: QpStatus
    kkt: Kkt
    iterations: int


@dataclass(frozen=True)
class Program:
    """The program in units in which M's columns, the rows of G (the box, then A) and the sizes of d and of what bounds
    demand are one.

    S (n,), V (n, n): M V = U S, where M is flat with S of their own; shadow: (n,) U^T d; normals: (n + m, n) of unit
    length, of the constraints on S V^T x; length: (n + m,) they had before; unit: that of
    d and M x"""

    M: np.ndarray
    d: np.ndarray
    G: np.ndarray
    low: np.ndarray
    high: np.ndarray
    S: np.ndarray
    V: np.ndarray
    shadow: np.ndarray
    normals: np.ndarray
    length: np.ndarray
    unit: float

    def gradient(self, x: np.ndarray, multipliers: np.ndarray) -> np.ndarray:
        """(n,) in the unit of M x: of objective and constraints on S V^T x."""
        return ((self.M @ x - self.d) @ self.M + multipliers @ self.G) @ self.V / self.S

    def judged(self, x: np.ndarray, multipliers: np.ndarray) -> "Answer":
        at, moved = self.G @ x, self.M @ x
        balance = ((moved - self.d) @ self.M + multipliers @ self.G) @ self.V / self.S
        complementarity = feasibility = 0.0
        held = multipliers.nonzero()[0]
        if len(held):
            claimed, length = multipliers[held], self.length[held]
            apart = np.abs(at[held] - np.where(claimed > 0, self.high[held], self.low[held]))
            complementarity = float(np.minimum(np.abs(claimed) * length, apart / length).max())
        outside = np.maximum(self.low - at, at - self.high)
        broken = (outside > 0).nonzero()[0]
        if len(broken):
            nearest = np.where(self.low > at, self.low, self.high)[broken]
            terms = np.abs(self.G[broken]) @ np.abs(x)
            # A length of 1e-14 in M x is rounding, whatever the terms.
            size = np.maximum(np.maximum(np.abs(nearest), terms), 1e-14 / TOLERANCE * self.length[broken])
            feasibility = float((outside[broken] / size).max())
        kkt = Kkt(sqrt(balance @ balance), complementarity, feasibility)
        size = sqrt(max(self.d @ self.d, moved @ moved)) or 1.0
        return Answer(x, multipliers, kkt, max(kkt.missed / size, feasibility))


@dataclass(frozen=True)
class Answer:
    """x (n,) and the multipliers (n + m,) of a program, with their residuals; error: the largest, relative to d and
    M x."""

    x: np.ndarray
    multipliers: np.ndarray
    kkt: Kkt
    error: float


def solve_qp(
    M: np.ndarray,
    d: np.ndarray,
    A: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    box: np.ndarray,
    backend: Backend = "active_set",
) -> QpSolution:
    """M (rows, n), d (rows,), A (m, n), lower and upper (m,), box (n, 2).

    `active_set`: exact, refined until only rounding is left. `osqp`: operator splitting with polish, a second opinion
    that costs a hundred times as much. Where M is flat the answer is one of those that are as good."""
    m, n = A.shape
    low, high = np.concatenate([box[:, 0], lower]), np.concatenate([box[:, 1], upper])
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        program, variables, multipliers = _scaled(M, d, A, low, high)
        if program is None:
            return _no_answer(m, n, _complaint(M, d, A, low, high), 0)
        answer, iterations = _BACKENDS[backend](program)
        if answer is None:
            return _no_answer(m, n, QpStatus.INFEASIBLE, iterations)
        # The box holds exactly in the user's units too.
        x = np.minimum(np.maximum(answer.x * variables, box[:, 0]), box[:, 1])
        force = answer.multipliers * multipliers
    if not np.isfinite(x.sum() + force.sum()):
        return _no_answer(m, n, QpStatus.INACCURATE, iterations)
    allowed = max(TOLERANCE, min(_DOUBTFUL, _ROUNDING * program.S[0] / program.S.min()))
    # Written so that a residual of NaN is inaccurate too.
    accurate = answer.error <= allowed and answer.kkt.feasibility <= TOLERANCE
    status = QpStatus.OPTIMAL if accurate else QpStatus.INACCURATE
    return QpSolution(x, force[n:], force[:n], status, answer.kkt.of(program.unit), iterations)


def residuals(
    M: np.ndarray,
    d: np.ndarray,
    A: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    box: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    z: np.ndarray,
) -> Kkt:
    """Of any x and multipliers of a program that has a solution."""
    low, high = np.concatenate([box[:, 0], lower]), np.concatenate([box[:, 1], upper])
    program, variables, multipliers = _scaled(M, d, A, low, high)
    return program.judged(x / variables, np.concatenate([z, y]) / multipliers).kkt.of(program.unit)


def _complaint(M: np.ndarray, d: np.ndarray, A: np.ndarray, low: np.ndarray, high: np.ndarray) -> QpStatus:
    """What is wrong with a program that cannot be solved as it stands."""
    if not all(np.isfinite(each).all() for each in (M, d, A)) or np.isnan(low).any() or np.isnan(high).any():
        return QpStatus.NOT_FINITE
    closed = (low > high).any() or (low == np.inf).any() or (high == -np.inf).any()
    return QpStatus.INFEASIBLE if closed else QpStatus.INACCURATE  # the latter: numbers too far apart for arithmetic


def _scaled(
    M: np.ndarray, d: np.ndarray, A: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[Program | None, np.ndarray, np.ndarray]:
    """The program, None where it cannot be one, and the units of its x and multipliers. Scaled by largest entries:
    their squares need not be numbers."""
    n = A.shape[1]
    column = np.abs(M).max(axis=0, initial=0.0)
    if not column.all():  # a variable without part in the objective: its box is its measure
        width = high[:n] - low[:n]
        column = np.where(column > 0, column, np.where(np.isfinite(width) & (width > 0), 1 / width, 1.0))
    A = A / column
    row = np.abs(A).max(axis=1, initial=0.0)
    row = 1 / np.where(row > 0, row, 1.0)
    scale = np.concatenate([column, row])
    demanded = np.maximum(np.maximum(low, -high), 0.0) * scale
    unit = float(max(np.abs(d).max(initial=0.0), demanded.max())) or 1.0
    M, d, A, low, high = M / column, d / unit, A * row[:, None], low * (scale / unit), high * (scale / unit)
    if not (np.isfinite(M.sum() + d.sum() + A.sum()) and (low <= high).all()):
        return None, column, row
    return _program(M, d, A, low, high, unit), unit / column, unit * scale


def _program(
    M: np.ndarray, d: np.ndarray, A: np.ndarray, low: np.ndarray, high: np.ndarray, unit: float = 1.0
) -> Program:
    n = M.shape[1]
    U, found, Vt = np.linalg.svd(M, full_matrices=len(M) < n)
    k = int((found > _FLAT * found[0]).sum()) if len(found) else 0
    S, shadow = np.full(n, _HELD * found[0] if k else 1.0), np.zeros(n)
    S[:k], shadow[:k] = found[:k], d @ U[:, :k]
    G = np.concatenate([np.eye(n), A])
    normals = G @ Vt.T / S
    length = np.sqrt((normals * normals).sum(axis=1))
    length = np.where(length > 0, length, 1.0)
    return Program(M, d, G, low, high, S, Vt.T, shadow, normals / length[:, None], length, unit)


def _no_answer(m: int, n: int, status: QpStatus, iterations: int) -> QpSolution:
    nothing = Kkt(*[float("nan")] * 3)
    return QpSolution(np.full(n, np.nan), np.full(m, np.nan), np.full(n, np.nan), status, nothing, iterations)


def _active_set(p: Program) -> tuple[Answer | None, int]:
    """By rounds: each solves for the step from the last answer, with the gradient there and bounds from there on. One
    is enough unless M is flat or nearly so. None where there is no answer, and the changes of the active set."""
    none, total = np.zeros(len(p.low)), 0
    x, shadow, best = np.zeros(len(p.S)), p.shadow, None
    for _ in range(_ROUNDS):
        at, shift = p.G @ x, p.normals @ shadow
        low, high, blur = (p.low - at) / p.length - shift, (p.high - at) / p.length - shift, np.abs(shift)
        found = least_length(p.normals, low, high, blur)
        if found is None:
            break
        total += found.changes
        if not found.feasible:
            return None, total
        now = _refined(p, found, x + p.V @ ((shadow + found.y) / p.S))
        slow = best is not None and not now.error < 0.5 * best.error
        best = now if best is None or now.error < best.error else best
        if slow or now.error <= _ROUNDED:
            break
        x, shadow = now.x, -p.gradient(now.x, none)
    return best or p.judged(x, none), total


def _refined(p: Program, found: ActiveSet, x: np.ndarray) -> Answer:
    """x and multipliers on the active constraints, by iterative refinement with the factors at hand."""
    n, which, sign, force = len(x), found.which, found.sign, found.force
    bound = np.where(sign > 0, p.low[which], p.high[which])
    boxed, best = which < n, None
    for _ in range(_REFINEMENTS + 1):
        multipliers = np.zeros(len(p.low))
        if len(which):
            x[which[boxed]] = bound[boxed]
            multipliers[which] = -sign * force / p.length[which]
        now = p.judged(np.minimum(np.maximum(x, p.low[:n]), p.high[:n]), multipliers)
        slow = best is not None and not now.error < 0.5 * best.error
        best = now if best is None or now.error < best.error else best
        if slow or now.error <= _ROUNDED:
            break
        step = -p.gradient(x, multipliers)
        left = sign * (bound - p.G[which] @ x) / p.length[which]
        change = left @ found.T - step @ found.Q
        force = np.maximum(force + found.T @ change, 0.0)
        x = x + p.V @ ((step + found.Q @ change) / p.S)
    return best


def _osqp(p: Program) -> tuple[Answer | None, int]:
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


_BACKENDS: dict[str, Callable[[Program], tuple[Answer | None, int]]] = {"active_set": _active_set, "osqp": _osqp}
