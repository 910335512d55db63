"""Newton's method on the contact law written as one equation, for many points without object and from a good start.

With the local force p = lambda - r gap, r > 0 of each point, the law says that every force is the projection of p:

    lambda = P(p)      P: 0 where p_n <= 0; else p_n along the normal, and along the surface p_t cut to length mu p_n

(Alart and Curnier, *A mixed formulation for frictional contact problems prone to Newton like solution methods*, 1991).
P has a derivative on each piece, so that Newton's method ends within a few linear systems, exactly, once it knows
which points are open, stick and slip."""

import numpy as np
from numba import njit
from scipy.optimize import nnls

from cfem.contact.law.modes import Mode

ITERATIONS, HALVINGS = 40, 4
MODES = Mode.OPEN, Mode.STICK, Mode.SLIP
EXACT = 1e-13  # of the largest force: change of a force in the last step


def newton(
    W: np.ndarray, free: np.ndarray, mu: float, start: np.ndarray | None = None
) -> tuple[np.ndarray | None, int]:
    """Forces (m, 3) N in the frames of the surface, None where it does not converge, and how many systems it solved. W
    (3m, 3m) mm/N and free (3m,) mm: see `cfem.contact.law.problem`; mu: of friction; start (m, 3) N: forces, zero
    unless given."""
    lam = np.zeros((len(free) // 3, 3)) if start is None else np.array(start, float).reshape(-1, 3)
    converged, systems = _newton(np.ascontiguousarray(W, float), np.ascontiguousarray(free, float), float(mu), lam)
    return lam if converged else None, systems


@njit(cache=True, error_model="numpy")
def _newton(W, free, mu, lam):
    """`newton` from lam (m, 3) N, which it overwrites. Returns whether it converged, and the systems solved."""
    A, constant, sound = _scaled(W, free)
    if not sound:
        return False, 0
    converged, systems = _iterate(A, constant, mu, lam.reshape(-1))
    if converged:
        _clean(lam, mu)
    return converged, systems


@njit(cache=True, error_model="numpy")
def _iterate(A, constant, mu, lam):
    """Newton's method from lam (3 m,), which it overwrites. Returns whether it converged, and the systems solved."""
    n, largest, forces = len(lam), 0.0, 0.0  # by loops: whole arrays take seconds to compile
    F, D, trial, step, J = np.empty(n), np.empty((n // 3, 3, 3)), np.empty(n), np.empty(n), np.empty((n, n))
    size = _missing(lam, A, constant, mu, F, D)
    for a in range(n):
        forces = max(forces, abs(constant[a]))
    for iteration in range(1, ITERATIONS + 1):
        if not _step(A, F, D, mu, J, step):
            return False, iteration
        share = 1.0
        for halving in range(HALVINGS + 1):
            for a in range(n):
                trial[a] = lam[a] + share * step[a]
            now = _missing(trial, A, constant, mu, F, D)
            if now < size or halving == HALVINGS:
                break
            share /= 2
        size, largest = now, 0.0
        for a in range(n):
            lam[a] = trial[a]
            largest = max(largest, abs(lam[a]))
        if not np.isfinite(size):
            return False, iteration
        if size <= EXACT * max(largest, forces):
            return True, iteration
    return False, ITERATIONS


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract"})
def _missing(lam, A, constant, mu, F, D):
    """lambda - P(p) into F, the derivatives (m, 3, 3) of P by p into D; the largest |F|, inf where it is not finite."""
    largest = 0.0
    for i in range(len(lam) // 3):
        for a in range(3 * i, 3 * i + 3):
            p = -constant[a]
            for b in range(len(lam)):
                p += A[a, b] * lam[b]
            F[a] = p
        project(F[3 * i : 3 * i + 3], mu, D[i])
        for a in range(3 * i, 3 * i + 3):
            F[a] = lam[a] - F[a]
            if not np.isfinite(F[a]):
                return np.inf
            largest = max(largest, abs(F[a]))
    return largest


@njit(cache=True, error_model="numpy")
def project(p, mu, D):
    """P of one point in place of its p (3,), and its derivative D (3, 3)."""
    D[:] = 0.0
    if not p[0] > 0:
        p[:] = 0.0
        return
    D[0, 0] = 1.0
    if not mu > 0:
        p[1], p[2] = 0.0, 0.0
        return
    length, limit = np.sqrt(p[1] * p[1] + p[2] * p[2]), mu * p[0]
    if length <= limit:
        D[1, 1], D[2, 2] = 1.0, 1.0
        return
    share, along = limit / length, (p[1] / length, p[2] / length)
    for a in range(2):
        p[1 + a] *= share
        D[1 + a, 0] = mu * along[a]
        for b in range(2):
            D[1 + a, 1 + b] = share * ((1.0 if a == b else 0.0) - along[a] * along[b])


@njit(cache=True, error_model="numpy")
def _step(A, F, D, mu, J, step):
    """Newton's step (I - D A) step = -F. Rows without derivative need no system: without friction those along the
    surface, and all of open points. J: room. False where it is singular."""
    n, c, kept, known = len(F), 0, np.empty(len(F), dtype=np.int64), False
    for a in range(n):
        if D[a // 3, 0, 0] > 0 and (mu > 0 or a % 3 == 0):
            kept[c] = a
            c += 1
            step[a] = 0.0
        else:
            step[a] = -F[a]
            known |= F[a] != 0
    fixed = np.zeros(n)  # A step, of what is known
    if known:
        for a in range(n):
            for b in range(n):
                fixed[a] += A[a, b] * step[b]
    right = np.empty(c)
    for row in range(c):
        a = kept[row]
        i, d = a - a % 3, D[a // 3, a % 3]
        right[row] = -F[a] + d[0] * fixed[i] + d[1] * fixed[i + 1] + d[2] * fixed[i + 2]
        for column in range(c):
            b = kept[column]
            J[row, column] = -(d[0] * A[i, b] + d[1] * A[i + 1, b] + d[2] * A[i + 2, b])
        J[row, row] += 1.0
    if not eliminate(J, right.reshape(-1, 1)):
        return False
    for row in range(c):
        step[kept[row]] = right[row]
    return True


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract"})
def eliminate(J, by):
    """Solves J x = by (c, k) in place, J the leading block of (c, c), by Gauss's elimination with pivots. False where
    it is singular."""
    c, k = by.shape
    for i in range(c):
        pivot = i
        for r in range(i + 1, c):
            if abs(J[r, i]) > abs(J[pivot, i]):
                pivot = r
        if not abs(J[pivot, i]) > 0:
            return False
        if pivot != i:
            for b in range(i, c):
                J[i, b], J[pivot, b] = J[pivot, b], J[i, b]
            for b in range(k):
                by[i, b], by[pivot, b] = by[pivot, b], by[i, b]
        for r in range(i + 1, c):
            share = J[r, i] / J[i, i]
            if share != 0:
                for b in range(i + 1, c):
                    J[r, b] -= share * J[i, b]
                for b in range(k):
                    by[r, b] -= share * by[i, b]
    for i in range(c - 1, -1, -1):
        for r in range(i + 1, c):
            for b in range(k):
                by[i, b] -= J[i, r] * by[r, b]
        for b in range(k):
            by[i, b] /= J[i, i]
    return True


def scaled(W: np.ndarray, free: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """A and c of p = A lambda - c, None where a point does not yield."""
    A, constant, sound = _scaled(np.ascontiguousarray(W, float), np.ascontiguousarray(free, float))
    return (A, constant) if sound else None


@njit(cache=True, error_model="numpy")
def _scaled(W, free):
    """A = I - diag(r) W and r free, r the inverse of the largest compliance of each point; False where a point has
    none, or a number is not finite."""
    A, constant = np.empty_like(W), np.empty_like(free)
    for i in range(0, len(free), 3):
        compliance = max(W[i, i], W[i + 1, i + 1], W[i + 2, i + 2])
        if not compliance > 0:
            return A, constant, False
        for a in range(i, i + 3):
            constant[a] = free[a] / compliance
            for b in range(len(free)):
                A[a, b] = -W[a, b] / compliance
                if not np.isfinite(A[a, b]):
                    return A, constant, False
            A[a, a] += 1.0
    return A, constant, True


def normal_forces(W: np.ndarray, free: np.ndarray) -> np.ndarray | None:
    """Forces (m, 3) N without friction: where Newton's method fails, those that minimise lambda . W_nn lambda / 2 +
    lambda . free_n over lambda >= 0 (Lawson and Hanson, *Solving Least Squares Problems*, 1974, chapter 23). None where
    W is not positive definite."""
    forces, _ = newton(W, free, 0.0)
    if forces is None:
        try:
            root = np.linalg.cholesky(W[::3, ::3]).T
        except np.linalg.LinAlgError:
            return None
        forces = np.zeros((len(free) // 3, 3))
        forces[:, 0] = nnls(root, -np.linalg.solve(root.T, free[::3]))[0]
    return forces


def projected(p: np.ndarray, mu: float) -> tuple[np.ndarray, np.ndarray]:
    """P (m, 3) of p (3 m,), and its derivatives (m, 3, 3)."""
    return _projected(np.array(p, float).reshape(-1, 3), float(mu))


@njit(cache=True, error_model="numpy")
def _projected(p, mu):
    D = np.empty((len(p), 3, 3))
    for i in range(len(p)):
        project(p[i], mu, D[i])
    return p, D


def by_friction(p: np.ndarray, mu: float) -> np.ndarray:
    """Derivative (3 m,) of P by mu."""
    p, slope = p.reshape(-1, 3), np.zeros((len(p) // 3, 3))
    length = np.hypot(p[:, 1], p[:, 2])
    slips = (p[:, 0] > 0) & (length > mu * p[:, 0])
    slope[slips, 1:] = (p[slips, 0] / length[slips])[:, None] * p[slips, 1:]
    return slope.ravel()


@njit(cache=True, error_model="numpy")
def _clean(lam, mu):
    """Forces (m, 3) of open points become exactly 0; no friction is beyond its limit by rounding."""
    least = 0.0
    for i in range(len(lam)):
        for a in range(3):
            least = max(least, EXACT * abs(lam[i, a]))
    for i in range(len(lam)):
        touches = lam[i, 0] > least
        for a in range(3):
            lam[i, a] = lam[i, a] if touches else 0.0
        length, limit = np.sqrt(lam[i, 1] ** 2 + lam[i, 2] ** 2), mu * lam[i, 0]
        if length > limit:
            lam[i, 1] *= limit / length
            lam[i, 2] *= limit / length
    return lam


def modes_from(lam: np.ndarray, mu: float) -> tuple[Mode, ...]:
    """Modes of points under forces (m, 3) N that obey the law: without friction to touch is to slip."""
    return of_numbers(_modes(lam, float(mu)))


def of_numbers(modes: np.ndarray) -> tuple[Mode, ...]:
    """Modes by their numbers (m,) among MODES."""
    return tuple([MODES[number] for number in modes.tolist()])


@njit(cache=True, error_model="numpy")
def _modes(lam, mu):
    modes = np.zeros(len(lam), dtype=np.int8)
    for i in range(len(lam)):
        if lam[i, 0] > 0:
            slips = np.sqrt(lam[i, 1] ** 2 + lam[i, 2] ** 2) >= mu * lam[i, 0] * (1 - 1e-9)
            modes[i] = 2 if slips else 1
    return modes
