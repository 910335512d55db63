"""A quadratic program that was tried, and what of its answer can be recomputed: the optimality conditions in units of
which the solver knows nothing, and whether a program that is called infeasible is."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

from cfem.control.search.qp import Backend, QpSolution, QpStatus, solve_qp
from cfem.stability.evidence import Evidence, LimitCheck

SMALL = 1e-6  # of the checks


@dataclass(frozen=True)
class HardProgram:
    """The program: minimise |M x - d|^2 / 2 subject to lower <= A x <= upper and box[:, 0] <= x <= box[:, 1]. unit:
    (n,) of each variable, for the checks: of the size of what it may be."""

    M: np.ndarray
    d: np.ndarray
    A: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    box: np.ndarray
    unit: np.ndarray


@dataclass(frozen=True)
class ProgramTrial:
    program: HardProgram
    answer: QpSolution

    def evidence(self) -> Evidence:
        """Evidence of the answer: its optimality conditions, or that no point is feasible where it says so."""
        status = self.answer.status
        if status is QpStatus.OPTIMAL:
            checks = _optimality(self.program, self.answer)
            residual = max(check.value for check in checks)
        else:
            wrongly = status is QpStatus.INFEASIBLE and _has_a_point(self.program)
            checks, residual = [LimitCheck("points that satisfy what is called infeasible", float(wrongly), 0)], None
        return Evidence(
            status.name, status is QpStatus.OPTIMAL, tuple(checks), residual, iterations=self.answer.iterations
        )


def attempt(make: Callable[[], HardProgram], backend: Backend) -> Callable[[], ProgramTrial]:
    def work() -> ProgramTrial:
        program = make()
        answer = solve_qp(program.M, program.d, program.A, program.lower, program.upper, program.box, backend)
        return ProgramTrial(program, answer)

    return work


def _optimality(program: HardProgram, answer: QpSolution) -> list[LimitCheck]:
    """Residuals of the scaled program, in the max norm: variables by their unit, rows by their norm."""
    unit, x = program.unit, answer.x / program.unit
    row = np.maximum(np.abs(program.A * unit).max(axis=1, initial=0.0), 1e-300)
    # stationarity: M^T M x - M^T d + A^T y + z = 0
    curved, pull = unit * (program.M.T @ (program.M @ answer.x)), -unit * (program.M.T @ program.d)
    rows, walls = unit * (program.A.T @ answer.y), unit * answer.z
    size = max(*(float(np.abs(part).max()) for part in (curved, pull, rows, walls)), 1e-300)
    # feasibility: low <= (x, A x) <= high, and complementarity: a multiplier only at the bound of its sign
    constrained = np.concatenate([x, program.A @ answer.x / row])
    low = np.concatenate([program.box[:, 0] / unit, program.lower / row])
    high = np.concatenate([program.box[:, 1] / unit, program.upper / row])
    multiplier = np.concatenate([walls, answer.y * row]) / size
    outside = np.maximum(np.maximum(low - constrained, constrained - high), 0).max()
    held = multiplier != 0
    loose = np.abs(multiplier[held] * (constrained - np.where(multiplier > 0, high, low))[held])
    largest = max(1.0, float(np.abs(constrained).max()))
    return [
        LimitCheck(
            "numbers that are not finite", float((~np.isfinite(np.concatenate([x, answer.y, answer.z]))).sum()), 0
        ),
        LimitCheck("stationarity", float(np.abs(curved + pull + rows + walls).max() / size), SMALL),
        LimitCheck("bounds overstepped", float(outside / largest), SMALL),
        LimitCheck("forces of bounds that are not reached", float(loose.max(initial=0.0) / largest), SMALL),
    ]


def _has_a_point(program: HardProgram) -> bool:
    """True where some point satisfies the constraints, by linear programming."""
    if (program.box[:, 0] > program.box[:, 1]).any() or (program.lower > program.upper).any():
        return False
    unit = program.unit
    row = np.maximum(np.abs(program.A * unit).max(axis=1, initial=0.0), 1e-300)
    A = program.A * unit / row[:, None]
    rows, limits = np.vstack([A, -A]), np.concatenate([program.upper / row, -program.lower / row])
    bounded = np.isfinite(limits)
    solution = linprog(np.zeros(len(unit)), rows[bounded], limits[bounded], bounds=program.box / unit[:, None])
    return solution.status == 0
