"""The state that belongs to a choice of mode at every point: equations, no inequalities.

Open: lambda = 0. Stick: gap = 0. Slip: gap_n = 0 and lambda_t = mu lambda_n d, with slip = -alpha d. This friction
is not associated with the normal motion: the equations are unsymmetric and may have several solutions or none.
The directions d are unknown: Newton from several of them.

A mode is a choice of complementary variables: Cottle, Pang, Stone, *The Linear Complementarity Problem* (1992),
chapter 1."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import count as counting
from itertools import islice, product

import numpy as np

from cfem.contact.law.check import residuals
from cfem.contact.law.problem import ContactProblem, Law

CONDITION = 1e12  # beyond it a system counts as singular
VALID = 1e-8  # largest residual of `check` of a state that satisfies its law
SAME = 1e-6  # relative distance below which two states are one
_STARTS = {1: 96, 2: 144, 3: 216}


class Mode(Enum):
    """Mode of one point. Without friction `SLIP` is touching, and there is no stick."""

    OPEN = "open"
    STICK = "stick"
    SLIP = "slip"


class ModeStatus(Enum):
    """How the equations ended; the value is the sentence that the user reads."""

    SOLVED = "solved"
    SINGULAR = "the modes leave the state undetermined: one of the many states"
    INCONSISTENT = "the equations of the modes contradict each other, or no start led to a solution"


@dataclass(frozen=True)
class ModeSolution:
    """Solutions of the equations of the modes: the distinct ones that satisfy the law, or else the one that violates it
    least; none where the equations have no solution.

    lam, xi: (c, 3m) N and (c, k)
    violation: (c, m) worst residual of each point (see `check`)
    residual: (c,) the worst of all points"""

    lam: np.ndarray
    xi: np.ndarray
    violation: np.ndarray
    residual: np.ndarray
    status: ModeStatus

    @property
    def valid(self) -> bool:
        return len(self.residual) > 0 and bool(self.residual[0] <= VALID)


def modes_of(problem: ContactProblem, law: Law) -> tuple[Mode, ...]:
    """The modes that a point has under the law."""
    if law == "bilateral":
        return (Mode.STICK,)
    if law == "signorini" or problem.mu == 0:
        return (Mode.OPEN, Mode.SLIP)
    return (Mode.OPEN, Mode.STICK, Mode.SLIP)


def understood(problem: ContactProblem, law: Law, modes: Sequence[Mode]) -> tuple[Mode, ...]:
    """The modes as the law knows them: without friction to stick is to touch, and bilateral points stick."""
    known = modes_of(problem, law)
    return tuple(mode if mode in known else known[-1] for mode in modes)


def solve_mode(problem: ContactProblem, law: Law, modes: Sequence[Mode], quick: bool = False) -> ModeSolution:
    """States in which each point has its mode of `modes`. quick: fewer starts where directions of slip are unknown."""
    p, modes = problem.normalised, understood(problem, law, modes)
    states, status = _solutions(p, law, modes, quick)
    if len(states):
        states = _best(p, law, states)
    else:
        status = ModeStatus.INCONSISTENT
    lam, xi = np.split(states, [len(p.free)], axis=1)
    violations, u = residuals(p, law, lam, xi), problem.units
    return ModeSolution(lam * u.force, xi * u.motion, violations.points, violations.largest, status)


def _best(p: ContactProblem, law: Law, states: np.ndarray) -> np.ndarray:
    """The valid and distinct ones of states (c, 3m + k), the best first; if none is valid the least bad one."""
    largest = residuals(p, law, *np.split(states, [len(p.free)], axis=1)).largest
    order = np.argsort(largest)
    order = order[largest[order] <= VALID] if largest[order[0]] <= VALID else order[:1]
    return states[order[distinct(states[order])]]


def distinct(states: np.ndarray) -> list[int]:
    """Which of states (c, n) are not repetitions of an earlier one."""
    kept: list[int] = []
    for i, state in enumerate(states):
        apart = np.abs(states[kept] - state).max(axis=1, initial=0.0)
        if (apart > SAME * (1 + np.abs(state).max())).all():
            kept.append(i)
    return kept


def _solutions(p: ContactProblem, law: Law, modes: tuple[Mode, ...], quick: bool) -> tuple[np.ndarray, ModeStatus]:
    """States (c, 3m + k) of the equations, and whether their system determines them."""
    if law == "coulomb" and p.mu > 0 and Mode.SLIP in modes:
        return _newton(p, modes, quick), ModeStatus.SOLVED
    M, c, _ = linear_equations(p, modes)
    z, solved, regular = _solve(M, c)
    return z[None][[solved]], ModeStatus.SOLVED if regular else ModeStatus.SINGULAR


def linear_equations(p: ContactProblem, modes: Sequence[Mode]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """M z = c with z = (lam, xi), M (n, n), c (n,), and S (n, 3m), the derivative of M z - c with respect to `free`;
    no point slips with friction."""
    n3 = len(p.free)
    S, T = np.zeros((n3 + p.k, n3)), np.zeros((n3 + p.k, n3))
    for i, mode in enumerate(modes):
        rows = np.arange(3 * i, 3 * i + 3)
        fixed = {Mode.OPEN: 0, Mode.SLIP: 1, Mode.STICK: 3}[mode]  # how many of the gaps are zero, n first
        S[rows[:fixed], rows[:fixed]] = T[rows[fixed:], rows[fixed:]] = 1.0
    T[n3:] = p.motion.T
    M = S @ np.hstack([p.W, -p.motion])
    M[:, :n3] += T
    c = -S @ p.free
    c[n3:] += p.load
    return M, c, S


def _solve(M: np.ndarray, c: np.ndarray) -> tuple[np.ndarray, bool, bool]:
    """Solution z (n,) of M z = c; whether it solves it; whether the system is regular. Of a singular system that has
    solutions the smallest one."""
    try:
        inverse = np.linalg.inv(M)
        regular = bool(np.abs(M).sum(axis=1).max() * np.abs(inverse).sum(axis=1).max() < CONDITION)
    except np.linalg.LinAlgError:
        regular = False
    if not regular:
        inverse = np.linalg.pinv(M, rcond=1 / CONDITION)
    z = inverse @ c
    z += inverse @ (c - M @ z)
    missing, size = np.abs(c - M @ z).max(), 1 + np.abs(z).max()
    return z, bool(missing <= 1e-10 * size and np.isfinite(size)), regular


def slip_equations(
    p: ContactProblem, modes: Sequence[Mode], y: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """F (B, n), dF/dy (B, n, n) and dF/dfree (n, 3m), y = (lam, xi, angles of d, alpha) (B, n)."""
    n3, sliding = len(p.free), [i for i, mode in enumerate(modes) if mode is Mode.SLIP]
    s, n = len(sliding), n3 + p.k + 2 * len(sliding)
    S, T = np.zeros((n, n3)), np.zeros((n, n3))
    J = np.zeros((len(y), n, n))
    angles, alphas = y[:, n3 + p.k : n3 + p.k + s], y[:, n3 + p.k + s :]
    for i, mode in enumerate(modes):
        diagonal = range(3 * i, 3 * i + 3)
        which = T if mode is Mode.OPEN else S
        which[diagonal, diagonal] = 1.0
    T[n3 : n3 + p.k] = p.motion.T
    for j, i in enumerate(sliding):
        t = np.arange(3 * i + 1, 3 * i + 3)
        rows = n3 + p.k + 2 * j + np.arange(2)
        S[t, t], T[t, t], S[rows, t] = 0.0, 1.0, 1.0
        d = np.stack([np.cos(angles[:, j]), np.sin(angles[:, j])], axis=1)
        across = np.stack([-d[:, 1], d[:, 0]], axis=1)
        J[:, t, 3 * i] = -p.mu * d
        J[:, t, n3 + p.k + j] = -p.mu * y[:, 3 * i : 3 * i + 1] * across
        J[:, rows, n3 + p.k + s + j] = d
        J[:, rows, n3 + p.k + j] = alphas[:, j : j + 1] * across
    J[:, :, : n3 + p.k] += S @ np.hstack([p.W, -p.motion])
    J[:, :, :n3] += T
    # Bilinear in what the angles multiply: linear in the rest, which gives the value.
    linear = np.concatenate([y[:, : n3 + p.k], np.zeros((len(y), s)), alphas], axis=1)
    constant = S @ p.free
    constant[n3 : n3 + p.k] -= p.load
    return np.einsum("bij,bj->bi", J, linear) + constant, J, S


def start_angles(count: int, quick: bool) -> np.ndarray:
    """Directions (starts, count) spread over the circles."""
    total = 6 if quick else _STARTS.get(count, 200)
    per = round(total ** (1 / count))
    if per >= 4:
        grid = np.array(list(product(range(per), repeat=count)))
        return 2 * np.pi * (grid + 0.5 * np.arange(count) / count) / per
    # A Kronecker sequence: the fractional parts of multiples of square roots of primes.
    primes = (n for n in counting(2) if all(n % k for k in range(2, n)))
    roots = np.sqrt(list(islice(primes, count)))
    return 2 * np.pi * ((np.arange(1, total + 1)[:, None] * roots) % 1.0)


def with_angles(p: ContactProblem, modes: Sequence[Mode], angles: np.ndarray) -> np.ndarray:
    """Unknowns (B, n) whose other parts solve `slip_equations` as well as they can at these angles (B, s)."""
    n3, s = len(p.free), angles.shape[1]
    y = np.zeros((len(angles), n3 + p.k + 2 * s))
    turning = slice(n3 + p.k, n3 + p.k + s)
    y[:, turning] = angles
    F, J, _ = slip_equations(p, modes, y)
    fixed = np.delete(J, np.arange(turning.start, turning.stop), axis=2)
    rest = -np.einsum("bij,bj->bi", np.linalg.pinv(fixed, rcond=1e-10), F)
    y[:, : n3 + p.k], y[:, turning.stop :] = rest[:, : n3 + p.k], rest[:, n3 + p.k :]
    return y


def _balanced(p: ContactProblem, modes: tuple[Mode, ...]) -> bool:
    """True where some forces on the points that touch balance the load."""
    wrenches = p.motion[np.repeat([mode is not Mode.OPEN for mode in modes], 3)]
    unbalanced = p.load - wrenches.T @ (np.linalg.pinv(wrenches.T) @ p.load)
    return bool(np.abs(unbalanced).max(initial=0.0) <= SAME)


def _newton(p: ContactProblem, modes: tuple[Mode, ...], quick: bool) -> np.ndarray:
    """Solutions (c, 3m + k) where points slip with friction, repetitions included."""
    n3 = len(p.free)
    if not _balanced(p, modes):
        return np.zeros((0, n3 + p.k))
    s = modes.count(Mode.SLIP)
    y, done = with_angles(p, modes, start_angles(s, quick)), []
    for _ in range(25):
        F, J, _ = slip_equations(p, modes, y)
        try:
            step = np.linalg.solve(J, -F[..., None])[..., 0]
        except np.linalg.LinAlgError:
            step = -np.einsum("bij,bj->bi", np.linalg.pinv(J, rcond=1e-12), F)
        turn = np.abs(step[:, n3 + p.k : n3 + p.k + s]).max(axis=1)
        y = y + step / np.maximum(1.0, turn)[:, None]
        size = 1 + np.abs(y).max(axis=1)
        converged = np.abs(step).max(axis=1) < 1e-13 * size
        done.append(y[converged])
        y = y[~converged & np.isfinite(size) & (size < 1e12)]
        if not len(y):
            break
    y = np.vstack([*done, y])
    size = 1 + np.abs(y).max(axis=1, initial=0.0)
    return y[np.abs(slip_equations(p, modes, y)[0]).max(axis=1) <= 1e-10 * size, : n3 + p.k]
