"""Small convex quadratic programs, with an answer that can be checked without trusting the solver.

    minimise  x^T H x / 2 + f^T x    subject to   lower <= A x <= upper,   box[:, 0] <= x <= box[:, 1]

Problems are normalised first: variables by the width of their box, rows to unit norm, the objective to unit
curvature. Bounds of +-inf are no bounds. Multipliers are positive where an upper bound holds and negative
where a lower one does: H x + f + A^T y + z = 0."""

from dataclasses import dataclass
from enum import Enum
from typing import Literal

import numpy as np

Backend = Literal["daqp", "osqp"]
TOLERANCE = 1e-7  # largest KKT residual of the normalised problem that counts as solved
NEARLY_FLAT = 1e-7  # smallest curvature, relative to the largest, below which an exact answer is doubted


class QpStatus(Enum):
    """How a solve ended; the value is the sentence that the user reads."""

    OPTIMAL = "optimal"
    INFEASIBLE = "the bounds exclude each other"
    INACCURATE = "the solver's answer does not satisfy the optimality conditions"
    NOT_FINITE = "the problem holds numbers that are not finite"


@dataclass(frozen=True)
class Kkt:
    """Residuals of the normalised problem, dimensionless, recomputed from x and the multipliers alone.

    stationarity: |H x + f + A^T y + z|, relative to the largest of its terms
    feasibility: largest violation of a bound
    complementarity: largest |multiplier| times the distance from the bound that it claims
    gap: |primal - dual objective|, relative to the primal's terms"""

    stationarity: float
    feasibility: float
    complementarity: float
    gap: float

    @property
    def largest(self) -> float:
        return max(self.stationarity, self.feasibility, self.complementarity, self.gap)


@dataclass(frozen=True)
class QpSolution:
    """x (n,), y (m,) multipliers of the rows, z (n,) of the box, all in the user's units; NaN where there is
    no answer."""

    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    status: QpStatus
    kkt: Kkt
    iterations: int


@dataclass(frozen=True)
class _Problem:
    """The normalised problem; its bounds hold the box first, then the rows."""

    H: np.ndarray
    f: np.ndarray
    A: np.ndarray
    lower: np.ndarray
    upper: np.ndarray


def solve_qp(
    H: np.ndarray,
    f: np.ndarray,
    A: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    box: np.ndarray,
    backend: Backend = "daqp",
) -> QpSolution:
    """H (n, n) symmetric positive semidefinite, f (n,), A (m, n), lower and upper (m,), box (n, 2).

    `daqp`: dual active set, exact and the fastest measured; its set-up costs so little that no workspace is
    kept. `osqp`: operator splitting with polish, a second opinion that costs a hundred times as much."""
    m, n = A.shape
    numbers, bounds = (H, f, A), (box, lower, upper)
    if not all(np.isfinite(each).all() for each in numbers) or any(np.isnan(each).any() for each in bounds):
        return _no_answer(m, n, QpStatus.NOT_FINITE, 0)
    low, high = box.T
    if (low > high).any() or (lower > upper).any():
        return _no_answer(m, n, QpStatus.INFEASIBLE, 0)
    width = _widths(H, low, high)
    row = np.sqrt(((A * width) ** 2).sum(axis=1))
    row[row == 0.0] = 1.0
    Hs = H * width * width[:, None]
    curvature = float(np.abs(Hs).max()) or 1.0
    problem = _Problem(
        Hs / curvature,
        f * width / curvature,
        A * width / row[:, None],
        np.concatenate([low / width, lower / row]),
        np.concatenate([high / width, upper / row]),
    )
    x, multipliers, infeasible, iterations = _BACKENDS[backend](problem)
    if infeasible:
        return _no_answer(m, n, QpStatus.INFEASIBLE, iterations)
    kkt = _kkt(problem, x, multipliers)
    # Written so that a residual of NaN is inaccurate too.
    status = QpStatus.OPTIMAL if kkt.largest <= TOLERANCE else QpStatus.INACCURATE
    return QpSolution(
        x * width, multipliers[n:] * curvature / row, multipliers[:n] * curvature / width, status, kkt, iterations
    )


def _widths(H: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """(n,) box widths; where a box is open or closed to a point, to rounding, what brings the curvature to one."""
    width = high - low
    usable = np.isfinite(width) & (width > 1e-6 * np.maximum(np.abs(low), np.abs(high)))
    if usable.all():
        return width
    diagonal = np.diag(H)
    natural = 1 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    return np.where(usable, width, natural)


def _kkt(problem: _Problem, x: np.ndarray, multipliers: np.ndarray) -> Kkt:
    """Residuals in the max norm. The gap is zero where stationarity and complementarity are, and says so on
    its own."""
    n = len(x)
    curved = problem.H @ x
    forces = multipliers[:n] + problem.A.T @ multipliers[n:]
    stationarity = _largest(curved + problem.f + forces) / max(1.0, _largest(problem.f))
    at = np.concatenate([x, problem.A @ x])
    feasibility = max(0.0, float((problem.lower - at).max()), float((at - problem.upper).max()))
    bound = np.where(multipliers > 0, problem.upper, problem.lower)
    held = multipliers != 0
    claimed, bounds = multipliers[held], bound[held]
    complementarity = _largest(claimed * (at[held] - bounds)) / max(1.0, _largest(claimed))
    primal, support = float(x @ curved), float(claimed @ bounds)
    gap = abs(primal + float(problem.f @ x) + support) / max(1.0, abs(primal), abs(support))
    return Kkt(stationarity, feasibility, complementarity, gap)


def _largest(values: np.ndarray) -> float:
    return float(np.abs(values).max()) if values.size else 0.0


def _no_answer(m: int, n: int, status: QpStatus, iterations: int) -> QpSolution:
    nothing = Kkt(*[float("nan")] * 4)
    return QpSolution(np.full(n, np.nan), np.full(m, np.nan), np.full(n, np.nan), status, nothing, iterations)


def _daqp(problem: _Problem) -> tuple[np.ndarray, np.ndarray, bool, int]:
    """Exact where the smallest curvature allows it. Below about 1e-8 of the largest, the dual problem is too
    ill-conditioned for that (false "infeasible" too): proximal steps of growing weight then find an answer that
    is as good, and operator splitting is the last resort."""
    smallest = float(np.linalg.eigvalsh(problem.H)[0])
    exact = [0.0] if smallest >= 1e-12 else []
    total = 0
    for weight in exact + ([1e-4, 1e-5, 1e-6, 1e-3] if smallest < NEARLY_FLAT else []):
        x, multipliers, infeasible, iterations = _daqp_once(problem, weight)
        total += iterations
        if smallest >= NEARLY_FLAT or (not infeasible and _kkt(problem, x, multipliers).largest <= TOLERANCE):
            return x, multipliers, infeasible, total
    if infeasible:
        return x, multipliers, infeasible, total
    x, multipliers, infeasible, iterations = _osqp(problem)
    return x, multipliers, infeasible, total + iterations


def _daqp_once(problem: _Problem, weight: float) -> tuple[np.ndarray, np.ndarray, bool, int]:
    """weight: of the proximal term, relative to the largest curvature; 0 solves directly."""
    import daqp

    sense = np.zeros(len(problem.lower), dtype=np.int32)
    x, _, flag, info = daqp.solve(
        problem.H,
        problem.f,
        problem.A,
        problem.upper,
        problem.lower,
        sense,
        primal_tol=1e-10,
        eps_prox=weight,
    )
    # After a failure the multipliers are memory that nobody wrote.
    return x, info["lam"] if flag > 0 else np.full(len(sense), np.nan), flag == -1, info["iterations"]


def _osqp(problem: _Problem) -> tuple[np.ndarray, np.ndarray, bool, int]:
    from contextlib import redirect_stdout
    from io import StringIO

    import osqp
    from scipy.sparse import csc_matrix, triu

    rows = csc_matrix(np.vstack([np.eye(len(problem.f)), problem.A]))
    solver = osqp.OSQP()
    solver.setup(
        triu(csc_matrix(problem.H), format="csc"),
        problem.f,
        rows,
        problem.lower,
        problem.upper,
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
    infeasible = result.info.status.startswith("primal infeasible")
    return result.x, result.y, infeasible, int(result.info.iter)


_BACKENDS = {"daqp": _daqp, "osqp": _osqp}
