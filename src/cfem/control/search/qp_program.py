"""A quadratic program in units of its own, and what makes an answer of it right.

The coordinates are those of the objective, S V^T x with M = U S V^T, and residuals are lengths in them, in the unit of
M x: mm for an inverse step. The units of the variables and the widths of their bounds have no part in either."""

from dataclasses import dataclass
from math import isfinite, sqrt

import numpy as np

TOLERANCE = 1e-9  # largest residual of a solved program, relative to d and M x and to the terms of a bound
_FLAT, _HELD = 1e-13, 1e-5  # singular values: below the first M is flat, and gets the second about the last answer


@dataclass(frozen=True)
class Kkt:
    """Residuals of the optimality conditions, recomputed from x and the multipliers alone.

    stationarity: in the unit of M x, what M x would have to move by for the forces to balance
    complementarity: in the unit of M x, of each multiplier the smaller of its force and the distance from its bound
    feasibility: largest violation of a bound, relative to the bound and to the terms of the row"""

    stationarity: float
    complementarity: float
    feasibility: float

    def of(self, unit: float) -> "Kkt":
        """Residuals in a unit of M x that is `unit` times smaller."""
        return Kkt(self.stationarity * unit, self.complementarity * unit, self.feasibility)

    @property
    def missed(self) -> float:
        """Distance of M x from the optimum, to first order."""
        return max(self.stationarity, self.complementarity)


@dataclass(slots=True)  # frozen ones take longer to make, and each control step makes one
class Program:
    """Program in units in which M's columns, the rows of G (the box, then A) and the sizes of d and of what bounds
    demand are one.

    S, V: (n,), (n, n) with M V = U S, where M is flat with S of their own
    shadow: (n,) U^T d
    normals: (n + m, n) of unit length, of the constraints on S V^T x
    length: (n + m,) they had before
    unit: that of d and M x"""

    M: np.ndarray
    d: np.ndarray
    G: np.ndarray
    low: np.ndarray
    high: np.ndarray
    S: np.ndarray
    V: np.ndarray
    shadow: np.ndarray
    normals: np.ndarray
    length: np.ndarray
    unit: float

    @property
    def condition(self) -> float:
        """Largest singular value over the smallest."""
        return float(self.S[0] / self.S.min())

    def gradient(self, x: np.ndarray, multipliers: np.ndarray) -> np.ndarray:
        """Gradient (n,) in the unit of M x: of objective and constraints on S V^T x."""
        return ((self.M @ x - self.d) @ self.M + multipliers @ self.G) @ self.V / self.S

    def judged(self, x: np.ndarray, multipliers: np.ndarray) -> "QpAnswer":
        """Answer x with its residuals."""
        values, moved = self.G @ x, self.M @ x
        balance = ((moved - self.d) @ self.M + multipliers @ self.G) @ self.V / self.S
        complementarity = feasibility = 0.0
        held = multipliers.nonzero()[0]
        if len(held):
            claimed, length = multipliers[held], self.length[held]
            apart = np.abs(values[held] - np.where(claimed > 0, self.high[held], self.low[held]))
            complementarity = float(np.minimum(np.abs(claimed) * length, apart / length).max())
        outside = np.maximum(self.low - values, values - self.high)
        broken = (outside > 0).nonzero()[0]
        if len(broken):
            nearest = np.where(self.low > values, self.low, self.high)[broken]
            terms = np.abs(self.G[broken]) @ np.abs(x)
            # A length of 1e-14 in M x is rounding, whatever the terms.
            size = np.maximum(np.maximum(np.abs(nearest), terms), 1e-14 / TOLERANCE * self.length[broken])
            feasibility = float((outside[broken] / size).max())
        kkt = Kkt(sqrt(balance @ balance), complementarity, feasibility)
        size = sqrt(max(self.d @ self.d, moved @ moved)) or 1.0
        return QpAnswer(x, multipliers, kkt, max(kkt.missed / size, feasibility))


@dataclass(slots=True)
class QpAnswer:
    """Candidate x (n,) with multipliers (n + m,), and their residuals; error: the largest, relative to d and M x."""

    x: np.ndarray
    multipliers: np.ndarray
    kkt: Kkt
    error: float


def scaled(
    M: np.ndarray, d: np.ndarray, A: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[Program | None, np.ndarray, np.ndarray]:
    """Program, None where it cannot be one, and the units of its x and multipliers. Scaled by largest entries: their
    squares need not be numbers."""
    n = A.shape[1]
    column = np.abs(M).max(axis=0, initial=0.0)
    if not column.all():  # a variable without part in the objective: its box is its measure
        width = high[:n] - low[:n]
        column = np.where(column > 0, column, np.where(np.isfinite(width) & (width > 0), 1 / width, 1.0))
    A = A / column
    row = np.abs(A).max(axis=1, initial=0.0)
    row[row == 0.0] = 1.0
    row = 1 / row
    scale = np.concatenate([column, row])
    demanded = np.maximum(np.maximum(low, -high), 0.0) * scale
    unit = float(max(np.abs(d).max(initial=0.0), demanded.max())) or 1.0
    M, d, A, scale_of_bounds = M / column, d / unit, A * row[:, None], scale / unit
    low, high = low * scale_of_bounds, high * scale_of_bounds
    if not (low <= high).all() or not isfinite(M.sum() + d.sum() + A.sum()):
        return None, column, row
    return _program(M, d, A, low, high, unit), unit / column, unit * scale


def _program(M: np.ndarray, d: np.ndarray, A: np.ndarray, low: np.ndarray, high: np.ndarray, unit: float) -> Program:
    """Program of a scaled problem, whose objective is reduced by the singular values of M."""
    n = M.shape[1]
    U, S, Vt = np.linalg.svd(M, full_matrices=len(M) < n)
    shadow = d @ U
    if len(S) < n or S[-1] <= _FLAT * S[0]:
        k = np.count_nonzero(_FLAT * S[0] < S) if len(S) else 0
        held = np.full(n - k, _HELD * S[0] if k else 1.0)
        S, shadow = np.concatenate([S[:k], held]), np.concatenate([shadow[:k], np.zeros(n - k)])
    G = np.concatenate([np.eye(n), A])
    normals = G @ Vt.T / S
    length = np.sqrt((normals * normals).sum(axis=1))
    length[length == 0.0] = 1.0
    return Program(M, d, G, low, high, S, Vt.T, shadow, normals / length[:, None], length, unit)
