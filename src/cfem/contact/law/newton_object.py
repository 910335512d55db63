"""Newton's method (`cfem.contact.law.newton`) on problems with a rigid object that moves by itself: the unknowns are
the forces and the motion of the object, the equations the law and the object's balance."""

import numpy as np
from numba import njit

from cfem.contact.law.newton import EXACT, HALVINGS, ITERATIONS, _clean, eliminate, project
from cfem.contact.law.problem import ContactProblem

HUGE = 1e9  # of a problem's own units: no force or motion


def newton_with_object(
    problem: ContactProblem, mu: float, start: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray, int] | None:
    """Forces lam (m, 3) and motion xi (k,) of a normalised problem with an object, and how many systems it solved; None
    where it does not converge. start (3 m,): forces, the smallest that balance the load unless given."""
    W, G, n = problem.W, problem.motion, len(problem.free)
    if start is None:
        lam = np.linalg.lstsq(G.T, problem.load, rcond=None)[0]
        y = np.concatenate([lam, np.linalg.lstsq(G, W @ lam + problem.free, rcond=None)[0]])
    else:
        y = np.concatenate([start, np.zeros(problem.k)])
    arrays = (np.ascontiguousarray(array, float) for array in (W, G, problem.free, problem.load))
    converged, systems = balanced(*arrays, float(mu), y)
    return (y[:n].reshape(-1, 3), y[n:], systems) if converged else None


@njit(cache=True, error_model="numpy")
def balanced(W, G, free, load, mu, y):
    """Newton's method from y (3 m + k,), forces and motion, which it overwrites. W (3 m, 3 m), G (3 m, k), free (3 m,)
    and load (k,) of a normalised problem. Returns whether it converged, and the systems solved."""
    n, k = G.shape
    A, constant, size_of_load = np.empty((n, n + k)), np.empty(n), 0.0
    for i in range(0, n, 3):
        compliance = max(W[i, i], W[i + 1, i + 1], W[i + 2, i + 2])
        if not compliance > 0:
            return False, 0
        for a in range(i, i + 3):
            constant[a] = free[a] / compliance
            size_of_load = max(size_of_load, abs(constant[a]))
            for b in range(n):
                A[a, b] = -W[a, b] / compliance
            A[a, a] += 1.0
            for j in range(k):
                A[a, n + j] = G[a, j] / compliance
    for j in range(k):
        size_of_load = max(size_of_load, abs(load[j]))
    F, D, trial, step, J = (
        np.empty(n + k),
        np.empty((n // 3, 3, 3)),
        np.empty(n + k),
        np.empty(n + k),
        np.empty((n + k, n + k)),
    )
    size = _missing(y, A, G, constant, load, mu, F, D)
    for iteration in range(1, ITERATIONS + 1):
        if not _step(A, G, F, D, J, step):
            return False, iteration
        share = 1.0
        for halving in range(HALVINGS + 1):
            for a in range(n + k):
                trial[a] = y[a] + share * step[a]
                if not abs(trial[a]) < HUGE:
                    return False, iteration
            now = _missing(trial, A, G, constant, load, mu, F, D)
            if now < size or halving == HALVINGS:
                break
            share /= 2
        size, largest = now, size_of_load
        y[:] = trial
        for a in range(n):
            largest = max(largest, abs(y[a]))
        if size <= EXACT * largest:
            _clean(y[:n].reshape(-1, 3), mu)
            return True, iteration
    return False, ITERATIONS


@njit(cache=True, error_model="numpy")
def _missing(y, A, G, constant, load, mu, F, D):
    """What forces and motion y (3 m + k,) leave of the law and of the balance into F, the derivatives (m, 3, 3) of the
    projection into D; the largest |F|."""
    (n, k), largest = G.shape, 0.0
    for i in range(0, n, 3):
        for a in range(i, i + 3):
            p = -constant[a]
            for b in range(n + k):
                p += A[a, b] * y[b]
            F[a] = p
        project(F[i : i + 3], mu, D[i // 3])
        for a in range(i, i + 3):
            F[a] = y[a] - F[a]
    for j in range(k):
        F[n + j] = -load[j]
        for a in range(n):
            F[n + j] += G[a, j] * y[a]
    for a in range(n + k):
        largest = max(largest, abs(F[a]))
    return largest


@njit(cache=True, error_model="numpy")
def _step(A, G, F, D, J, step):
    """Newton's step. The forces of open points are known without a system. J: room. False where it is singular."""
    n, k = G.shape
    kept, c = np.empty(n + k, dtype=np.int64), 0
    for a in range(n):
        step[a] = -F[a]
        if D[a // 3, 0, 0] > 0:
            kept[c], step[a] = a, 0.0
            c += 1
    for j in range(k):
        kept[c + j], step[n + j] = n + j, 0.0
    right = np.empty((c + k, 1))
    for row in range(c):
        a = kept[row]
        i, d, right[row, 0] = a - a % 3, D[a // 3, a % 3], -F[a]
        for b in range(n):
            if step[b] != 0.0:
                right[row, 0] += (d[0] * A[i, b] + d[1] * A[i + 1, b] + d[2] * A[i + 2, b]) * step[b]
        for column in range(c + k):
            b = kept[column]
            J[row, column] = -(d[0] * A[i, b] + d[1] * A[i + 1, b] + d[2] * A[i + 2, b])
        J[row, row] += 1.0
    for j in range(k):
        row = c + j
        right[row, 0] = -F[n + j]
        for b in range(n):
            right[row, 0] -= G[b, j] * step[b]
        for column in range(c):
            J[row, column] = G[kept[column], j]
        for column in range(c, c + k):
            J[row, column] = 0.0
    if not eliminate(J, right):
        return False
    for row in range(c + k):
        step[kept[row]] = right[row, 0]
    return True
