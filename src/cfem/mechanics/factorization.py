"""Sparse symmetric factorisation A = L D L^T behind one small function: analysed once, refactored many times.

Two solvers, of which the faster one on this machine serves (choose_solver.py; CFEM_SOLVER names one):

- rslab: a plain wheel on every platform (MIT);
- pardiso: Intel's PARDISO by py-mkl-pardiso (MIT, with Intel's MKL inside; the extra `fast`; x86).

Both give the inertia and the same bits for the same input on one thread. A singular or non-finite matrix is reported,
never silently solved. Measured: docs/method.md."""

import os
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from cfem.core.errors import InputError
from cfem.core.optional import demand
from cfem.mechanics.assembly import Pattern
from cfem.mechanics.choose_solver import PACKAGES, fastest

# Early, so in the main thread: where the thread that loads it ends, its allocator crashes in the next new thread
# (mimalloc 3.3, github.com/microsoft/mimalloc/issues/1356).
with suppress(ImportError):
    import rslab


class SingularMatrixError(ArithmeticError):
    """The matrix is singular to rounding, or holds numbers that are not finite."""


@dataclass(frozen=True)
class Factor:
    """A factorised matrix. solve: B (n, k) -> A^-1 B (n, k); negative: number of negative eigenvalues of A (Sylvester's
    law of inertia)."""

    solve: Callable[[np.ndarray], np.ndarray]
    negative: int


# data (nnz,) of the lower triangle -> its factor; raises RuntimeError on a breakdown of the factorisation
Numeric = Callable[[np.ndarray], Factor]


def analyze(pattern: Pattern, solver: str | None = None) -> Numeric:
    """Symbolic phase, once a pattern. The function returned factors a data array (lower triangle); the factor before it
    must not be used any more.

    It raises SingularMatrixError: on a zero pivot, on entries that are not finite, and where the answer to a probing
    right-hand side shows a condition number beyond what double precision resolves."""
    numeric = SOLVERS[solver or solver_name()](pattern)
    probe = np.cos(np.arange(pattern.n_dof))[:, None]

    def factor(data: np.ndarray) -> Factor:
        """Factor of a data array, after its checks."""
        if not np.isfinite(data).all():
            raise SingularMatrixError("the stiffness matrix holds numbers that are not finite")
        if not data.any():
            raise SingularMatrixError("the stiffness matrix is zero")
        try:
            factorised = numeric(data)
        except RuntimeError as error:
            raise SingularMatrixError(str(error)) from error
        answer = factorised.solve(probe)
        if not np.isfinite(answer).all() or np.abs(answer).max() * np.abs(data).max() > 1e14:
            raise SingularMatrixError("the stiffness matrix is singular to within rounding")
        return factorised

    return factor


def solver_name() -> str:
    """Name of the solver that the environment asks for, else of the fastest on this machine. InputError where
    CFEM_SOLVER is not one."""
    wanted = os.environ.get("CFEM_SOLVER", "")
    if wanted and wanted not in SOLVERS:
        raise InputError(f"CFEM_SOLVER={wanted} is not a known solver", do=f"use one of {sorted(SOLVERS)}")
    if wanted:
        demand(PACKAGES[wanted], where=f"CFEM_SOLVER={wanted}")
    return wanted or fastest(analyze)


def _rslab(pattern: Pattern) -> Numeric:
    """Symbolic phase of rslab."""
    n = pattern.n_dof
    ones = sp.csc_matrix((np.ones(pattern.nnz), pattern.indices, pattern.indptr), shape=(n, n))
    symbolic = rslab.analyze(ones, path="ldlt", threads=1)

    def factor(data: np.ndarray) -> Factor:
        """Factor of a data array."""
        numeric = symbolic.factor(data)
        negative = int(numeric.diagnostics()["numeric"]["inertia"][1])
        return Factor(lambda B: numeric.solve_many(np.ascontiguousarray(B)), negative)

    return factor


def _pardiso(pattern: Pattern) -> Numeric:
    """Symbolic phase of PARDISO, whose factors share one memory."""
    os.environ.setdefault("MKL_NUM_THREADS", "1")
    import pymklpardiso as mkl

    n = pattern.n_dof
    indices, indptr = pattern.indices.astype(np.int32), pattern.indptr.astype(np.int32)
    # the lower triangle by columns is the upper triangle by rows
    upper = sp.csr_matrix((np.ones(pattern.nnz), indices, indptr), shape=(n, n))
    upper.data[indptr[:-1]] = 1e3 * n  # the numbers that the symbolic phase is given are replaced at once
    # PARDISO's iparm, counted from 0: METIS; no refinement; no scaling or matching, which would follow the numbers
    solver = mkl.PardisoSolver(upper, mkl.MTYPE_REAL_SYM_INDEF, {0: 1, 1: 2, 7: 0, 9: 13, 10: 0, 12: 0, 20: 1})
    latest = [0]

    def factor(data: np.ndarray) -> Factor:
        """Factor of a data array, which the next one replaces."""
        solver.refactor(data)
        latest[0] += 1
        own_number = latest[0]

        def solve(B: np.ndarray) -> np.ndarray:
            if latest[0] != own_number:
                raise RuntimeError("a factor was used after the next one had been made")
            return solver.solve(np.asfortranarray(B))

        return Factor(solve, int(solver.get_iparm_value(22)))

    return factor


SOLVERS: dict[str, Callable[[Pattern], Numeric]] = {"pardiso": _pardiso, "rslab": _rslab}
