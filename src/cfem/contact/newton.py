"""Newton's method on the contact law written as one equation, for many points without object and from a good start.

With the local force p = lambda - r gap, r > 0 of each point, the law says that every force is the projection of p:

    lambda = P(p)      P: 0 where p_n <= 0; else p_n along the normal, and along the surface p_t cut to length mu p_n

(Alart and Curnier, *A mixed formulation for frictional contact problems prone to Newton like solution methods*, 1991).
P has a derivative on each piece, so that Newton's method ends within a few linear systems, exactly, once it knows
which points are open, stick and slip."""

import numpy as np
from scipy.optimize import nnls

from cfem.contact.modes import Mode
from cfem.contact.problem import ContactProblem

ITERATIONS, HALVINGS = 40, 4
HUGE = 1e9  # of a problem's own units: no force or motion
PLANE = np.eye(2)
EXACT = 1e-13  # of the largest force: change of a force in the last step


def newton(
    W: np.ndarray, free: np.ndarray, mu: float, start: np.ndarray | None = None
) -> tuple[np.ndarray | None, int]:
    """(m, 3) N in the frames of the surface, None where it does not converge, and how many systems it solved. W
    (3m, 3m) mm/N and free (3m,) mm: see `cfem.contact.problem`; mu: of friction; start (m, 3) N: forces, zero unless
    given."""
    m, equation = len(free) // 3, scaled(W, free)
    if equation is None:
        return None, 0
    A, constant = equation
    A_blocks = A.reshape(m, 3, 3 * m)
    lam = np.zeros(3 * m) if start is None else np.asarray(start, float).ravel()
    F, D = _missing(lam, A, constant, mu)
    size = np.abs(F).max()
    eye = np.eye(3 * m)
    for iteration in range(1, ITERATIONS + 1):
        J = eye - (D @ A_blocks).reshape(3 * m, 3 * m)
        try:
            step = np.linalg.solve(J, -F)
        except np.linalg.LinAlgError:
            return None, iteration
        share = 1.0
        for halving in range(HALVINGS + 1):
            trial = lam + share * step
            F, D = _missing(trial, A, constant, mu)
            now = np.abs(F).max()
            if now < size or halving == HALVINGS:
                break
            share /= 2
        lam, size = trial, now
        largest = np.abs(lam).max()
        if not np.isfinite(largest):
            return None, iteration
        if size <= EXACT * max(largest, np.abs(constant).max()):
            return _clean(lam.reshape(m, 3), mu), iteration
    return None, ITERATIONS


def scaled(W: np.ndarray, free: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """A and c of p = A lambda - c, None where a point does not yield."""
    yields = np.diag(W).reshape(-1, 3).max(axis=1)
    if not (np.isfinite(W).all() and (yields > 0).all()):
        return None
    rate = np.repeat(1.0 / yields, 3)
    return np.eye(len(W)) - rate[:, None] * W, rate * free


def normal_forces(W: np.ndarray, free: np.ndarray) -> np.ndarray | None:
    """(m, 3) N without friction: where Newton's method fails, those that minimise lambda . W_nn lambda / 2 + lambda .
    free_n over lambda >= 0 (Lawson and Hanson, *Solving Least Squares Problems*, 1974, chapter 23). None where W is not
    positive definite."""
    found, _ = newton(W, free, 0.0)
    if found is None:
        try:
            root = np.linalg.cholesky(W[::3, ::3]).T
        except np.linalg.LinAlgError:
            return None
        found = np.zeros((len(free) // 3, 3))
        found[:, 0] = nnls(root, -np.linalg.solve(root.T, free[::3]))[0]
    return found


def newton_with_object(
    problem: ContactProblem, mu: float, start: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray, int] | None:
    """lam (m, 3) and xi (k,) of a normalised problem with an object, and how many systems it solved; None where it does
    not converge. start (3 m,): forces, the smallest that balance the load unless given.

    The unknowns are the forces and the motion of the object, the equations the law as above and its balance."""
    W, G, m = problem.W, problem.motion, problem.m
    yields = np.diag(W).reshape(m, 3).max(axis=1)
    if not (yields > 0).all():
        return None
    rate, n = np.repeat(1.0 / yields, 3), 3 * m
    A = np.hstack([np.eye(n) - rate[:, None] * W, rate[:, None] * G])  # p = A (lam, xi) - r free
    constant = rate * problem.free
    if start is None:
        lam = np.linalg.lstsq(G.T, problem.load, rcond=None)[0]
        y = np.concatenate([lam, np.linalg.lstsq(G, W @ lam + problem.free, rcond=None)[0]])
    else:
        y = np.concatenate([start, np.zeros(problem.k)])

    def equations(y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        found, D = projected(A @ y - constant, mu)
        J = np.zeros((len(y), len(y)))
        J[:n] = -(D @ A.reshape(m, 3, -1)).reshape(n, -1)
        J[:n, :n] += np.eye(n)
        J[n:, :n] = G.T
        return np.concatenate([y[:n] - found.ravel(), G.T @ y[:n] - problem.load]), J

    F, J = equations(y)
    for iteration in range(1, ITERATIONS + 1):
        try:
            step = np.linalg.solve(J, -F)
        except np.linalg.LinAlgError:
            return None
        size, share = np.abs(F).max(), 1.0
        for halving in range(HALVINGS + 1):
            trial = y + share * step
            if not np.abs(trial).max() < HUGE:
                return None
            F, J = equations(trial)
            if np.abs(F).max() < size or halving == HALVINGS:
                break
            share /= 2
        y, size = trial, np.abs(F).max()
        if size <= EXACT * max(np.abs(y[:n]).max(), np.abs(constant).max(), np.abs(problem.load).max()):
            return _clean(y[:n].reshape(m, 3), mu), y[n:], iteration
    return None


def _missing(lam: np.ndarray, A: np.ndarray, constant: np.ndarray, mu: float) -> tuple[np.ndarray, np.ndarray]:
    """lambda - P(p), and the derivatives (m, 3, 3) of P by p."""
    found, D = projected(A @ lam - constant, mu)
    return lam - found.ravel(), D


def projected(p: np.ndarray, mu: float) -> tuple[np.ndarray, np.ndarray]:
    """P (m, 3) of p (3 m,), and its derivatives (m, 3, 3)."""
    p = p.reshape(-1, 3)
    normal, m = p[:, 0], len(p)
    pressed = normal > 0
    D, found = np.zeros((m, 3, 3)), np.zeros((m, 3))
    D[:, 0, 0] = pressed
    found[:, 0] = np.where(pressed, normal, 0.0)
    if mu > 0:
        t, limit = p[:, 1:], mu * found[:, 0]
        length = np.sqrt(t[:, 0] ** 2 + t[:, 1] ** 2)
        slips = length > limit
        share = np.where(slips, limit / np.where(slips, length, 1.0), pressed)  # of t that friction holds
        along = t * ((slips & pressed) / np.where(slips, length, 1.0))[:, None]  # 0 where nothing slips
        found[:, 1:] = share[:, None] * t
        D[:, 1:, 0] = mu * along
        D[:, 1:, 1:] = share[:, None, None] * (PLANE - along[:, :, None] * along[:, None])
    return found, D


def by_friction(p: np.ndarray, mu: float) -> np.ndarray:
    """(3 m,) derivative of P by mu."""
    p, found = p.reshape(-1, 3), np.zeros((len(p) // 3, 3))
    length = np.hypot(p[:, 1], p[:, 2])
    slips = (p[:, 0] > 0) & (length > mu * p[:, 0])
    found[slips, 1:] = (p[slips, 0] / length[slips])[:, None] * p[slips, 1:]
    return found.ravel()


def _clean(lam: np.ndarray, mu: float) -> np.ndarray:
    """Forces of open points exactly 0, no friction beyond its limit by rounding."""
    largest = np.abs(lam).max(initial=0.0)
    lam = np.where(lam[:, :1] > EXACT * largest, lam, 0.0)
    if mu == 0:
        lam[:, 1:] = 0.0
        return lam
    length = np.sqrt(lam[:, 1] ** 2 + lam[:, 2] ** 2)
    over = length > mu * lam[:, 0]
    lam[over, 1:] *= (mu * lam[over, 0] / length[over])[:, None]
    return lam


def modes_from(lam: np.ndarray, mu: float) -> tuple[Mode, ...]:
    """Of forces (m, 3) N that obey the law: without friction to touch is to slip."""
    slips = np.hypot(lam[:, 1], lam[:, 2]) >= mu * lam[:, 0] * (1 - 1e-9)
    pressed = lam[:, 0] > 0
    return tuple(
        (Mode.SLIP if slip else Mode.STICK) if touch else Mode.OPEN for touch, slip in zip(pressed, slips, strict=True)
    )
