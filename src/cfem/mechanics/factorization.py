"""Sparse symmetric factorisation A = L D L^T behind one small function: analysed once, refactored many times.

rslab (MIT, a plain wheel on all platforms) keeps the symbolic phase and gives the inertia; its factors are the same
bits for any number of threads. A singular or non-finite matrix is reported, never silently solved."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from cfem.mechanics.assembly import Pattern


class SingularMatrixError(ArithmeticError):
    """The matrix is singular to rounding, or holds numbers that are not finite."""


@dataclass(frozen=True)
class Factor:
    """solve: B (n, k) -> A^-1 B (n, k); negative: number of negative eigenvalues of A (Sylvester's law of inertia)."""

    solve: Callable[[np.ndarray], np.ndarray]
    negative: int


def analyze(pattern: Pattern) -> Callable[[np.ndarray], Factor]:
    """Symbolic phase, once a pattern. The function returned factors a data array (lower triangle).

    It raises SingularMatrixError: on a zero pivot, on entries that are not finite, and where the answer to a probing
    right-hand side shows a condition number beyond what double precision resolves."""
    import rslab

    n = pattern.n_dof
    ones = sp.csc_matrix((np.ones(pattern.nnz), pattern.indices, pattern.indptr), shape=(n, n))
    symbolic = rslab.analyze(ones, path="ldlt", threads=1)
    probe = np.cos(np.arange(n))[:, None]

    def factor(data: np.ndarray) -> Factor:
        if not np.isfinite(data).all():
            raise SingularMatrixError("the stiffness matrix holds numbers that are not finite")
        try:
            numeric = symbolic.factor(data)
        except RuntimeError as error:
            raise SingularMatrixError(str(error)) from error
        answer = numeric.solve_many(probe)
        if not np.isfinite(answer).all() or np.abs(answer).max() * np.abs(data).max() > 1e15:
            raise SingularMatrixError("the stiffness matrix is singular to rounding")
        negative = int(numeric.diagnostics()["numeric"]["inertia"][1])
        return Factor(lambda B: numeric.solve_many(np.ascontiguousarray(B)), negative)

    return factor
