"""The equations of one step where the learned functions are expanded about a place near its middle.

M, grad Psi and the viscosity are those at `about` and, of M and grad Psi, their slopes there. What that leaves out is
of second order in how far the middle turns out to be from `about`, and this of third order in the step's length."""

from dataclasses import dataclass
from math import isfinite

import numpy as np
from scipy.linalg.lapack import dgetrf, dgetrs

from cfem.motion.model import MotionModel

NEAR = 1e-4  # of the half width of the learned box, from which the expansion is good
_ITERATIONS = 30
_SLOW = 0.03  # rate of the changes from which the slopes are taken again


@dataclass(frozen=True)
class SolvedStep:
    """A solved step, expanded to first order in its last change."""

    v: np.ndarray  # (n_q,) mean velocity of the step
    rest: np.ndarray  # residual dt/2 (dL/dq + Q) + p - M v, in the rows that are held
    impulse: np.ndarray  # M v


@dataclass
class Expansion:
    """Equations of a step of dt s from q with momenta p, expanded about a place.

    known: (n_q,) forces that do not depend on v
    M, dM: (n_q, n_q) and (n_a, n_q, n_q), mass at `about` (n_a,), and its slopes
    pull, stiff: (n_a,) and (n_a, n_a), grad Psi and its slope
    inner: (n_r, n_r) stiffness of eta
    drag: (n_q, n_q) slope of the viscous force by v
    scale: (n_q,) of q"""

    q: np.ndarray
    p: np.ndarray
    dt: float
    about: np.ndarray
    known: np.ndarray
    M: np.ndarray
    dM: np.ndarray
    pull: np.ndarray
    stiff: np.ndarray
    inner: np.ndarray
    drag: np.ndarray
    scale: np.ndarray

    def size(self, v: np.ndarray) -> float:
        """Size of a velocity, in units of q; a motion of a nanometre in the step, or its share of an amplitude, needs
        no digits."""
        return max(float(np.abs(v / self.scale).max()), 1e-6 / self.dt / float(self.scale.min()))

    def solved(self, v: np.ndarray, free: np.ndarray, tolerance: float) -> SolvedStep | None:
        """Step solved from v, whose entries `free` are changed, by Newton's method with the slopes at v, later ones
        where changes fall slowly, until the next change would be below the tolerance by the rate at which they have
        fallen; None where it does not end."""
        v, change, before, all_free = v.copy(), np.zeros(len(v)), np.inf, len(free) == len(v)
        small, slope, stale = tolerance * self.size(v), None, True
        for _ in range(_ITERATIONS):
            rest, Mv, turning = self._terms(v)
            if stale:
                slope = self._slope(turning)
                factor, pivots, failed = dgetrf(slope if all_free else slope[free[:, None], free])
                if failed:
                    return None
            if all_free:
                change = dgetrs(factor, pivots, rest)[0]
            else:
                change[free] = dgetrs(factor, pivots, rest[free])[0]
            v += change
            moved = float(np.abs(change / self.scale).max())
            if not isfinite(moved):
                return None
            first, rate = before == np.inf, min(moved / before, 1.0) if before < np.inf else 1.0
            before, stale = moved, rate > _SLOW and not first
            if moved * rate <= small:
                impulse = Mv + self.M @ change + change[: len(turning)] @ turning
                return SolvedStep(v, rest - slope @ change, impulse)
        return None

    def _slope(self, turning: np.ndarray) -> np.ndarray:
        """Minus that of what is left of the equations by v, but for how M differs from that at `about`."""
        n_a, quarter = len(self.pull), self.dt**2 / 4
        out = self.M + self.dt / 2 * self.drag
        out[:n_a, :n_a] += quarter * self.stiff
        out[n_a:, n_a:] += quarter * self.inner
        out[:, :n_a] += turning.T
        out[:n_a] -= turning
        return out

    def _terms(self, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Residual of the equations at v, M v, and dt/2 times the slope (n_a, n_q) of M v by the place."""
        n_a, half = len(self.pull), self.dt / 2
        middle = self.q + half * v
        ahead, by_turn = middle[:n_a] - self.about, (self.dM.reshape(-1, len(v)) @ v).reshape(n_a, -1)
        Mv = self.M @ v + ahead @ by_turn
        force = self.known - self.drag @ v
        force[:n_a] += by_turn @ v / 2 - self.pull - self.stiff @ ahead
        force[n_a:] -= self.inner @ middle[n_a:]
        return half * force + self.p - Mv, Mv, half * by_turn


def expansion(
    model: MotionModel, q: np.ndarray, p: np.ndarray, v: np.ndarray, dt: float, memory: np.ndarray
) -> Expansion:
    """Expansion of the motion about the middle of the step of dt s from q that v leads to. memory (terms, n_q): of the
    Prony terms."""
    about = q[: model.n_a] + dt / 2 * v[: model.n_a]
    pull, stiff = model.forces(about)
    M, dM, F = model.inertia(about)
    known, drag, term = np.zeros(model.n_q), np.zeros_like(M), 0
    for loss, form in zip(model.losses, F, strict=True):
        rate = loss.relaxation
        for share, tau in loss.prony:
            half = dt / (2 * tau)
            rate += share * dt / 2 / (1 + half)
            known -= form @ memory[term] * (share / (1 + half))
            term += 1
        drag += rate * form
    return Expansion(q, p, dt, about, known, M, dM, pull, stiff, model.inner, drag, model.scale)
