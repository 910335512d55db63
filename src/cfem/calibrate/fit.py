"""Bounded least squares from several starts."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import qmc

from cfem.core.errors import NumericalError

# z -> residuals (n_r,), Jacobian (n_r, n)
Problem = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
_TOLERANCE = 1e-10
_NEAR = 1e-3  # of the range: an end so near is tried


@dataclass(frozen=True)
class Fit:
    """From one start (n,): z (n,) in [0, 1]; cost: half the sum of squares; history: (k, n) and costs (k,) of every
    evaluation; failure: why it ended without an answer, z and cost then being the best that was seen; seconds: of CPU
    time."""

    start: np.ndarray
    z: np.ndarray
    cost: float
    history: np.ndarray
    costs: np.ndarray
    failure: str | None
    seconds: float


class _Seen:
    """Evaluates a problem and its Jacobian at once, remembers the last and the course of the costs."""

    def __init__(self, problem: Problem):
        self._problem, self.z, self.cost = problem, [], []

    def residuals(self, z: np.ndarray) -> np.ndarray:
        if not self.z or not np.array_equal(z, self.z[-1]):
            self._last = self._problem(z)
            self.z.append(z.copy())
            self.cost.append(0.5 * float(self._last[0] @ self._last[0]))
        return self._last[0]

    def jacobian(self, z: np.ndarray) -> np.ndarray:
        self.residuals(z)
        return self._last[1]


def fit(problem: Problem, start: np.ndarray) -> Fit:
    """Trust-region reflective (Branch, Coleman and Li, SIAM J. Sci. Comput. 21, 1999) from `start` (n,) in [0, 1]."""
    begin, seen, failure = time.process_time(), _Seen(problem), None
    inside = np.clip(start, 1e-6, 1 - 1e-6)
    try:
        least_squares(
            seen.residuals, inside, seen.jacobian, bounds=(0.0, 1.0), xtol=_TOLERANCE, ftol=_TOLERANCE, gtol=_TOLERANCE
        )
        # the search stays inside: an answer at an end of a range is approached, and never met
        near = seen.z[int(np.argmin(seen.cost))]
        end = np.where(np.minimum(near, 1 - near) < _NEAR, np.round(near), near)
        if not np.array_equal(end, near):
            seen.residuals(end)
    except NumericalError as error:
        failure = str(error)
    best = int(np.argmin(seen.cost)) if seen.cost else None
    z, cost = (inside, np.inf) if best is None else (seen.z[best], seen.cost[best])
    history = np.array(seen.z).reshape(-1, len(start))
    return Fit(start, z, cost, history, np.array(seen.cost), failure, time.process_time() - begin)


def best_of(fits: Sequence[Fit]) -> Fit:
    """NumericalError where none came to an answer."""
    good = [one for one in fits if one.failure is None]
    if not good:
        raise NumericalError(
            f"the fit failed from every start: {fits[0].failure}",
            do="choose starts nearer to the answer, or narrow the ranges",
        )
    return min(good, key=lambda one: one.cost)


def spread(count: int, n: int) -> np.ndarray:
    """(count, n) the middle, then Halton points."""
    return np.vstack([np.full((1, n), 0.5), qmc.Halton(n, scramble=False).random(count)[1:]])
