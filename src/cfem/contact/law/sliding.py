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

PARTS = 16  # of a step with friction: more of them change less than what is not linear in a step
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
    """Slip (m, 2) mm before the last part of a step, 0 where a part has no state.

    W (3m, 3m) mm/N, free (3m,) mm at the end of the step: see `cfem.contact.law.problem`
    begin (m, 3) mm: gaps and slips at the begin, under forces (m, 3) N"""
    first = begin.ravel() - W @ forces.ravel()
    slip = np.zeros((len(forces), 2))
    walked = _walk(np.ascontiguousarray(W), first, free, np.array(forces, float), float(mu), parts, slip)
    return slip if walked else np.zeros_like(slip)


@njit(cache=True, error_model="numpy")
def _walk(W, first, last, lam, mu, parts, slip):
    """Adds the slip of all parts but the last to `slip` (m, 2). False where one of them has no state."""
    m, free = len(lam), np.empty(len(last))
    for part in range(1, parts):
        for i in range(3 * m):
            free[i] = first[i] + part / parts * (last[i] - first[i])
        for i in range(m):
            for a in range(2):
                free[3 * i + 1 + a] -= slip[i, a]
        if not _newton(W, free, mu, lam)[0]:
            return False
        for i in range(m):
            if np.sqrt(lam[i, 1] ** 2 + lam[i, 2] ** 2) < (1 - STICKS) * mu * lam[i, 0]:
                continue
            for a in range(2):
                row = 3 * i + 1 + a
                slip[i, a] += free[row]
                for j in range(m):
                    for b in range(3):
                        slip[i, a] += W[row, 3 * j + b] * lam[j, b]
    return True
