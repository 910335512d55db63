"""Natural frequencies about an equilibrium from the factor that it has, and their derivatives by anything.

(A - w^2 M) phi = 0 on motions that leave the rows held as they are, by the Lanczos method on A^-1 M (shift-invert at 0;
Lehoucq, Sorensen and Yang, ARPACK Users' Guide, 1998). With H of these rows, phi of mass 1 and the multipliers nu of
A phi + H nu = w^2 M phi,

    d(w^2) = phi^T (dA - w^2 dM) phi + 2 nu^T dH^T phi

(Fox and Kapoor, AIAA J. 6, 1968; held rows added). That is the form -(2 b . phi - phi^T A phi) - w^2 phi^T M phi of
explicit.py with b = -H nu, stationary in phi and nu: the adjoint (adjoint.py) takes it as a column, and the
stress and the bending of a pulled state are in A. Where several modes have the lowest frequency, each by itself has no
derivative, and the mean of their w^2 has one."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator, eigsh

from cfem.core.errors import NumericalError
from cfem.equilibrium.derivatives.explicit import Columns
from cfem.equilibrium.derivatives.solved import solved
from cfem.equilibrium.motion.inertia import times_mass
from cfem.equilibrium.system.solution import Linearisation

_TOGETHER = 1e-6  # of w^2: modes of one frequency
_COUNT = 4  # modes that are computed, so that those of one frequency are among them


@dataclass(frozen=True)
class Vibration:
    """The lowest natural frequency. frequency: Hz; columns: of the k modes that have it, each of weight `share` in the
    frequency's derivative."""

    frequency: float
    columns: Columns
    share: float


def lowest(linear: Linearisation, mass: sp.csr_array, held: bool) -> Vibration:
    """Lowest undamped vibration. held: whether the actuators stand still, or pull with constant forces; mass: (n, n) t,
    of `mass_of`. NumericalError where the equilibrium is unstable so."""
    problem, evaluation = linear.problem, linear.at
    n_a = problem.robot.rows.n_a if held else 0
    H = evaluation.H[:, :n_a]
    n = problem.pattern.n_dof

    def heavy(q: np.ndarray) -> np.ndarray:
        return times_mass(problem, mass, evaluation.x, q.reshape(n, -1))

    def solve(b: np.ndarray) -> np.ndarray:
        return solved(linear, b)[0]

    squares, shapes, pulls = lowest_modes(solve, H, heavy, n, _COUNT)
    if not squares[0] > 0:
        actuators = "stand still" if held else "pull with constant forces"
        raise NumericalError(
            f"the equilibrium is unstable while its actuators {actuators}: it has no natural frequency"
        )
    k = int((squares <= squares[0] + _TOGETHER * abs(squares[0])).sum())
    square = float(squares[:k].mean())
    watched = problem.robot.rows.watched.stop
    v = np.zeros((linear.Z.shape[1], k))
    v[watched : watched + n_a] = -pulls[:, :k]
    frequency = float(np.sqrt(square) / (2 * np.pi))
    share = -1 / (8 * np.pi**2 * frequency) / k
    return Vibration(frequency, Columns(v, shapes[:, :k], np.full(k, square)), share)


def lowest_modes(
    solve: Callable[[np.ndarray], np.ndarray],
    H: np.ndarray,
    heavy: Callable[[np.ndarray], np.ndarray],
    n: int,
    count: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Lowest modes: squares (k,) 1/s^2, lowest first, shapes (n, k) of mass 1, and the multipliers nu (c, k) of the
    rows held, whose gradients are H (n, c); solve: A^-1 of (n, k); heavy: M times (n, k)."""
    ZH = solve(H) if H.shape[1] else H
    S = H.T @ ZH

    def answer(b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        v = solve(np.asarray(b, float).reshape(n, -1))
        if not len(S):
            return v, np.zeros((0, v.shape[1]))
        nu = np.linalg.solve(S, H.T @ v)
        return v - ZH @ nu, nu

    by_mass = LinearOperator((n, n), matvec=lambda b: heavy(b).ravel(), dtype=float)
    inverse = LinearOperator((n, n), matvec=lambda b: answer(b)[0].reshape(b.shape), dtype=float)
    stiff = LinearOperator((n, n), matvec=lambda b: b, dtype=float)  # of which shift-invert takes the shape alone
    begin = answer(by_mass.matvec(np.cos(1.7 * np.arange(n))))[0].ravel()
    count = min(count, n - len(S) - 1)
    squares, shapes = eigsh(stiff, count, by_mass, 0.0, OPinv=inverse, v0=begin, which="LM", tol=1e-10)
    order = np.argsort(squares)
    squares, shapes = squares[order], shapes[:, order]
    return squares, shapes, squares * answer(heavy(shapes))[1]
