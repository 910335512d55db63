"""Random programs with an optimum that is known because they are built around it: a point, forces of the bounds that
hold it, and the d for which these balance. Scaled by powers of two, which rounds nothing."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Known:
    """The arguments of solve_qp, least |M x - d| in its unit, and the size of d in it."""

    M: np.ndarray
    d: np.ndarray
    A: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    box: np.ndarray
    distance: float
    size: float

    @property
    def arguments(self) -> tuple[np.ndarray, ...]:
        return self.M, self.d, self.A, self.lower, self.upper, self.box

    def excess(self, x: np.ndarray) -> float:
        """Objective beyond the optimum, relative to what it is and to 1e-12 of what it is at x = 0."""
        found = np.linalg.norm((self.M @ x - self.d) / self.size)
        least = self.distance / self.size
        return float((found**2 - least**2) / max(least**2, 1e-12))

    def overstep(self, x: np.ndarray) -> float:
        """Largest violation, relative to the bound and to the terms of the row."""
        rows = np.vstack([np.eye(len(x)), self.A])
        low, high = np.concatenate([self.box[:, 0], self.lower]), np.concatenate([self.box[:, 1], self.upper])
        at, terms = rows @ x, np.abs(rows) @ np.abs(x)
        out = np.maximum(low - at, at - high)
        bound = np.where(low > at, low, high)
        broken = out > 0
        size = np.maximum(np.abs(bound), terms)[broken]
        # Bounds of zero are met to the rounding of what would move M x by its size.
        column = np.abs(self.M).max(axis=0)
        unit = self.size * np.abs(rows) @ (1 / np.where(column > 0, column, np.inf))
        return float((out[broken] / np.maximum(size, 1e-5 * unit[broken])).max(initial=0.0))


def known(rng: np.random.Generator, kind: str) -> Known:
    """kind: plain; conditioned (M up to 1e5); flat (columns that are copies, or fewer rows than columns); generous
    (bounds up to 1e9 from the optimum); reachable (d on the range of M); scaled (units apart by 2^26); extreme (by
    2^480)."""
    n = int(rng.integers(1, 8))
    m, extra = int(rng.integers(0, 2 * n + 1)), int(rng.integers(1, 4))
    M, A = rng.normal(size=(n + extra, n)), rng.normal(size=(m, n))
    if kind == "conditioned":
        U, _, V = np.linalg.svd(M, full_matrices=False)
        M = (U * 10.0 ** rng.uniform(-5, 0, n)) @ V
    if kind == "flat":
        copies = rng.integers(0, n, n)
        M = M[: int(rng.integers(1, n + extra + 1)), copies]
    if m > 1 and rng.random() < 0.3:
        A[-1] = A[0] * rng.choice([-1.0, 1.0, 2.0])
    x = np.round(rng.normal(size=n), 6)
    x[rng.random(n) < 0.2] = 0.0
    held = rng.random(m) < 0.3
    y = np.where(held, rng.normal(size=m), 0.0)
    free = rng.random(n) < (1.0 if kind == "reachable" else 0.6)
    if kind == "reachable":
        y[:] = 0.0
    # r = M x - d with M^T r + A^T y + z = 0, z = 0 on the free variables
    need = -(A.T @ y)[free]
    particular = np.linalg.lstsq(M[:, free].T, need, rcond=None)[0] if free.any() else np.zeros(len(M))
    if free.any() and not np.allclose(M[:, free].T @ particular, need, atol=1e-9):
        y[:], particular = 0.0, np.zeros(len(M))
    across = rng.normal(size=len(M))
    if free.any():
        Q = np.linalg.qr(M[:, free])[0] if kind != "flat" else np.linalg.svd(M[:, free], full_matrices=False)
        if kind == "flat":
            U, s, _ = Q
            Q = U[:, s > 1e-9]
        across = across - Q @ (Q.T @ across)
    r = np.zeros(len(M)) if kind == "reachable" else particular + across
    z = -(M.T @ r + A.T @ y)
    z[free] = 0.0
    apart = 10.0 ** rng.uniform(-2, 9 if kind == "generous" else 0.5, (2, n + m))
    multiplier, at = np.concatenate([z, y]), np.concatenate([x, A @ x])
    low, high = at - apart[0], at + apart[1]
    low[rng.random(n + m) < 0.2], high[rng.random(n + m) < 0.2] = -np.inf, np.inf
    low, high = np.where(multiplier < 0, at, low), np.where(multiplier > 0, at, high)
    meet = rng.random(n + m) < 0.05
    low, high = np.where(meet, at, low), np.where(meet, at, high)
    d = M @ x - r
    spread = {"scaled": 13, "extreme": 240}.get(kind, 0)
    columns, rows = (2.0 ** rng.integers(-spread, spread + 1, k) for k in (n, m))
    whole = 2.0 ** rng.integers(-spread, spread + 1)
    scale = np.concatenate([1 / columns, rows])
    low, high = low * scale, high * scale
    return Known(
        M * columns * whole,
        d * whole,
        A * columns * rows[:, None],
        low[n:],
        high[n:],
        np.column_stack([low, high])[:n],
        float(np.linalg.norm(r) * whole),
        float(np.linalg.norm(d) * whole) or whole,
    )


def without_a_point(rng: np.random.Generator, kind: str) -> tuple[np.ndarray, ...]:
    """Arguments of a program with one row more, which needs more than some of the bounds together allow."""
    program = known(rng, kind)
    n = len(program.box)
    rows = np.vstack([np.eye(n), program.A])
    low = np.concatenate([program.box[:, 0], program.lower])
    high = np.concatenate([program.box[:, 1], program.upper])
    unit = program.size / np.maximum(np.abs(program.M).max(axis=0), 1e-300)
    if not np.isfinite(high).any():
        high[0] = max(low[0], 0.0) + unit[0]
    chosen = rng.permutation(np.flatnonzero(np.isfinite(high)))[: int(rng.integers(1, 3))]
    # each in units of its own bound or terms, so that none drowns the other
    terms = np.maximum(np.abs(high[chosen]), np.abs(rows[chosen]) @ unit)
    share = rng.uniform(0.5, 2, len(chosen)) / terms
    least = share @ high[chosen] + rng.uniform(1e-3, 1) * (share @ terms)
    A = np.vstack([program.A, share @ rows[chosen]])
    lower, upper = np.append(low[n:], least), np.append(high[n:], np.inf)
    return program.M, program.d, A, lower, upper, np.column_stack([low, high])[:n]


KINDS = ("plain", "conditioned", "flat", "generous", "reachable", "scaled", "extreme")
