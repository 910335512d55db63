"""The C active set against the optimality conditions, recomputed here from the problem, and the QP of control."""

import ctypes
import tempfile
from pathlib import Path

import numpy as np
import pytest
from export.embedded import needs_compiler

from cfem.control.search.qp import QpStatus, solve_qp
from cfem.export.compiled.build import STANDARD, compiler, run
from cfem.export.firmware.copying import SOURCES

pytestmark = needs_compiler
N, ROWS, CONSTRAINTS = 12, 40, 36
OPTIMAL, INFEASIBLE, FLAT = 0, 1, 2
COUNT = 1000


class QpAnswer(ctypes.Structure):
    _fields_ = [
        ("x", ctypes.c_double * N),
        ("multipliers", ctypes.c_double * CONSTRAINTS),
        ("kkt", ctypes.c_double),
        ("iterations", ctypes.c_int),
    ]


@pytest.fixture(scope="module")
def solver():
    sizes = [f"-DCFEM_QP_VARIABLES={N}", f"-DCFEM_QP_ROWS={ROWS}", f"-DCFEM_QP_CONSTRAINTS={CONSTRAINTS}"]
    with tempfile.TemporaryDirectory() as place:
        (Path(place) / "cfem_data.h").touch()
        out = Path(place) / "qp.so"
        command = [compiler(), *STANDARD, "-O2", *sizes, f"-I{place}", "-shared", "-fPIC", "-o", str(out)]
        run([*command, *(str(SOURCES / "controller" / name) for name in ("cfem_qp.c", "cfem_active.c")), "-lm"], place)
        function = ctypes.CDLL(str(out)).cfem_qp

    def solve(M, d, A, low, high):
        keep = [np.ascontiguousarray(a, float) for a in (M, d, A, low, high)]
        M_, d_, A_, low_, high_ = (a.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for a in keep)
        answer, n = QpAnswer(), M.shape[1]
        status = function(n, len(M), M_, d_, len(A), A_, n, low_, high_, ctypes.byref(answer))
        return status, np.array(answer.x[:n]), np.array(answer.multipliers[: n + len(A)])

    return solve


def problem(rng, badly_scaled: bool, feasible: bool = True):
    """M, d, A, low, high of a random program about a feasible point, a fifth of its bounds open; infeasible: with one
    row more, that some bounds together forbid. Badly scaled: M of condition up to 1e5 (H = M^T M up to 1e10), variables
    and rows in units from 1e-4 to 1e4."""
    n = int(rng.integers(1, 9))
    m, rows = int(rng.integers(0, 2 * n + 1)), n + int(rng.integers(0, 4))
    M, A, x0 = rng.normal(size=(rows, n)), rng.normal(size=(m, n)), rng.normal(size=n)
    if badly_scaled:
        U, _, V = np.linalg.svd(M, full_matrices=False)
        M = (U * 10 ** rng.uniform(-5, 0, n)) @ V
    d = rng.normal(size=rows) * (10 ** rng.uniform(-2, 3) if badly_scaled else 3.0)
    at = np.concatenate([x0, A @ x0])
    low, high = at - rng.uniform(0, 1, n + m), at + rng.uniform(0, 1, n + m)
    low[rng.random(n + m) < 0.2] = -np.inf
    high[rng.random(n + m) < 0.2] = np.inf
    if not feasible:
        high[0] = min(high[0], at[0] + 1)
        rows_of = np.vstack([np.eye(n), A])
        bounded = np.flatnonzero(np.isfinite(high))
        chosen = rng.choice(bounded, min(len(bounded), int(rng.integers(1, 3))), replace=False)
        share = rng.uniform(0.5, 2, len(chosen))
        least = share @ high[chosen] + rng.uniform(1e-3, 1)  # more than the chosen bounds let this row become
        A = np.vstack([A, share @ rows_of[chosen]])
        low, high, m = np.append(low, least), np.append(high, least + 1), m + 1
    if badly_scaled:
        variables, of_rows = 10 ** rng.uniform(-4, 4, n), 10 ** rng.uniform(-4, 4, m)
        objective, scale = 10 ** rng.uniform(-3, 3), np.concatenate([1 / variables, of_rows])
        M, d, A = M * variables * objective, d * objective, A * variables * of_rows[:, None]
        low, high = low * scale, high * scale
    return M, d, A, low, high


def kkt(M, d, A, low, high, x, multipliers) -> float:
    """Largest residual: variables in units of their box (or of what brings the curvature to one), rows of unit norm,
    the objective of unit curvature."""
    n = len(x)
    width = (high - low)[:n]
    width = np.where(np.isfinite(width), width, 1 / np.linalg.norm(M, axis=0))
    curvature = ((M * width) ** 2).sum(axis=0).max()
    G = np.vstack([np.eye(n), A])
    length, at = np.linalg.norm(G * width, axis=1), G @ x
    slope = np.abs(width * (M.T @ (M @ x - d) + G.T @ multipliers)).max()
    stationarity = slope / max(curvature, np.abs(width * (M.T @ d)).max())
    feasibility = max(0.0, ((low - at) / length).max(), ((at - high) / length).max())
    claimed = np.where(multipliers > 0, high, low)
    held = multipliers != 0
    scaled = np.abs(multipliers * length / curvature)[held]
    apart = (np.abs(at[held] - claimed[held]) / length[held] * scaled / np.maximum(1, scaled)).max(initial=0.0)
    return max(stationarity, feasibility, apart)


@pytest.mark.parametrize("badly_scaled", [False, True])
def test_every_answer_is_optimal(solver, badly_scaled):
    rng = np.random.default_rng(7)
    worst = 0.0
    for _ in range(COUNT):
        program = problem(rng, badly_scaled)
        status, x, multipliers = solver(*program)
        assert status == OPTIMAL
        worst = max(worst, kkt(*program, x, multipliers))
    assert worst <= (1e-9 if badly_scaled else 1e-12)


@pytest.mark.parametrize("badly_scaled", [False, True])
def test_bounds_that_exclude_each_other_are_always_found(solver, badly_scaled):
    rng = np.random.default_rng(8)
    assert all(solver(*problem(rng, badly_scaled, feasible=False))[0] == INFEASIBLE for _ in range(COUNT))


def test_it_agrees_with_the_solver_of_control(solver):
    rng = np.random.default_rng(9)
    for _ in range(100):
        M, d, A, low, high = problem(rng, badly_scaled=False)
        n = M.shape[1]
        expected = solve_qp(M, d, A, low[n:], high[n:], np.column_stack([low, high])[:n])
        assert expected.status is QpStatus.OPTIMAL
        assert solver(M, d, A, low, high)[1] == pytest.approx(expected.x, rel=1e-10, abs=1e-10)


def test_an_objective_that_is_flat_is_refused(solver):
    nothing = np.zeros((0, 2))
    assert solver(np.array([[1.0, 1.0]]), np.ones(1), nothing, -np.ones(2), np.ones(2))[0] == FLAT
    assert solver(np.array([[1.0, np.nan], [0, 1]]), np.ones(2), nothing, -np.ones(2), np.ones(2))[0] == FLAT


def test_bounds_that_stand_for_none_change_nothing(solver):
    rng = np.random.default_rng(10)
    for _ in range(50):
        M, d, A, low, high = problem(rng, badly_scaled=False)
        _, expected, _ = solver(M, d, A, low, high)
        status, x, _ = solver(M, d, A, np.maximum(low, -1e30), np.minimum(high, 1e30))
        assert status == OPTIMAL and x == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_closed_boxes_and_meeting_rows(solver):
    M, d = np.eye(2), np.array([3.0, 4.0])
    status, x, _ = solver(M, d, np.array([[1.0, 1.0]]), np.array([1.0, -9, 2.0]), np.array([1.0, 9, 2.0]))
    assert status == OPTIMAL and x == pytest.approx([1.0, 1.0], abs=1e-12)
    status, x, _ = solver(M, d, np.array([[1.0, 1.0]]), np.array([-9, -9, 2.0]), np.array([0.5, 1.5, 9.0]))
    assert status == OPTIMAL and x == pytest.approx([0.5, 1.5], abs=1e-12)
