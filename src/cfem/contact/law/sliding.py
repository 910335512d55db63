"""Friction along a step: how far points slide before its last part.

Friction opposes the motion of each moment. The law of contact that is posed once for a step opposes the mean motion of
that step, so that where the direction of sliding turns, forces are wrong by as much as it turns in half of the step. So
a step is walked in equal parts on its linearisation

    gap = W lambda + free,    free changing evenly from the begin of the step to its end,

and the law of its end counts slip from where the last part begins. Stresses of an ideally plastic material turn in the
same way (Krieg and Krieg, *Accuracies of numerical solution methods for the elastic-perfectly plastic model*, 1977)."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from cfem.contact.law.newton import _newton
from cfem.contact.law.newton_object import balanced
from cfem.contact.law.problem import ContactProblem

PARTS = 16  # of a step with friction: more of them change less than what is not linear in a step
FOLLOWED = 8  # corrections that follow friction along a step: later ones take that slip as it is
STICKS = 1e-9  # of the largest friction: less is missing where a point slides


@dataclass(frozen=True, eq=False)
class StepBegin:
    """Gaps and forces of p pairs at the begin of a step.

    gaps: (p, 3) mm, normal gap, and slip from where it counts
    push: (p, 3) N in the scene's axes
    parts: in which the step is walked"""

    gaps: np.ndarray
    push: np.ndarray
    parts: int = PARTS


def slid(
    W: np.ndarray, free: np.ndarray, begin: np.ndarray, forces: np.ndarray, mu: float, parts: int = PARTS
) -> np.ndarray:
    """Slip (m, 2) mm before the last part of a step. A part that has no state is walked together with the next.

    W (3m, 3m) mm/N, free (3m,) mm at the end of the step: see `cfem.contact.law.problem`
    begin (m, 3) mm: gaps and slips at the begin, under forces (m, 3) N"""
    nothing = np.empty((len(free), 0)), np.empty(0), np.empty(0)
    first, walked = begin.ravel() - W @ forces.ravel(), np.array(forces, float).ravel()
    return _walk(np.ascontiguousarray(W), first, free, *nothing, walked, float(mu), parts)


def slid_on_object(
    problem: ContactProblem, begin: np.ndarray, forces: np.ndarray, motion: np.ndarray, parts: int = PARTS
) -> np.ndarray:
    """Slip (m, 2) mm before the last part of a step, on an object that moves by itself: as `slid` has it.

    problem: at the end of the step
    begin (m, 3) mm: gaps and slips at the begin, under forces (m, 3) N
    motion (k,): of the object from where the problem is linear about to where the step begins"""
    if not problem.k:
        return slid(problem.W, problem.free, begin, forces, problem.mu, parts)
    p, u = problem.normalised, problem.units
    lam, xi = forces.ravel() / u.force, motion / u.motion
    first = begin.ravel() / u.length - p.W @ lam + p.motion @ xi
    W, G = np.ascontiguousarray(p.W), np.ascontiguousarray(p.motion)
    loads = lam @ G, p.load
    return u.length * _walk(W, first, p.free, G, *loads, np.concatenate([lam, xi]), float(p.mu), parts)


@njit(cache=True, error_model="numpy")
def _walk(W, first, last, G, first_load, last_load, y, mu, parts):
    """Slip (m, 2) of all parts but the last, from forces and motion y (3 m + k,)."""
    n, k = G.shape
    slip, free, load, then = np.zeros((n // 3, 2)), np.empty(n), np.empty(k), y.copy()
    for part in range(1, parts):
        share = part / parts
        for i in range(0, n, 3):
            for a in range(3):
                free[i + a] = first[i + a] + share * (last[i + a] - first[i + a])
            for a in range(2):
                free[i + 1 + a] -= slip[i // 3, a]
        for j in range(k):
            load[j] = first_load[j] + share * (last_load[j] - first_load[j])
        lam = y[:n].reshape(-1, 3)
        solved = balanced(W, G, free, load, mu, y)[0] if k else _newton(W, free, mu, lam)[0]
        if not solved:
            y[:] = then
            continue
        then[:] = y
        for i in range(n // 3):
            if np.sqrt(lam[i, 1] ** 2 + lam[i, 2] ** 2) < (1 - STICKS) * mu * lam[i, 0]:
                continue
            for row in range(3 * i + 1, 3 * i + 3):
                gap = free[row]
                for b in range(n):
                    gap += W[row, b] * y[b]
                for j in range(k):
                    gap -= G[row, j] * y[n + j]
                slip[i, row - 3 * i - 1] += gap
    return slip
