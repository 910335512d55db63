"""Nonlinear least squares within bounds, from one start or several: min |r(u)|^2 / 2, low <= u <= high.

Weights divide rows of r, and what is known of the unknowns beforehand adds rows to it. The search is the trust-region
reflective method (Branch, Coleman and Li, SIAM J. Sci. Comput. 21, 1999)."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import qmc

from cfem.core.errors import NumericalError

# problem(u (n,), with_jacobian) -> residuals (n_r,) and, where it is asked for, their Jacobian (n_r, n)
Problem = Callable[[np.ndarray, bool], tuple[np.ndarray, np.ndarray | None]]
_END = 1e-3  # share of its range, within which an unknown is tried at the end


@dataclass(frozen=True)
class FitSettings:
    """Settings of a fit's search.

    low, high:   bounds of the unknowns: (n,), or one number for all
    margin:      share of its range by which each unknown starts inside its bounds, where these are finite
    xtol, ftol:  relative changes of the unknowns and of the cost at which the search ends
    by_jacobian: whether the trust region scales each unknown by its column of the Jacobian
    try_ends:    whether unknowns that end near a bound are tried on it: the search approaches bounds from inside
    barrier:     value of all residuals where the problem has no answer; None where the fit fails there
    most:        evaluations, None for scipy's 100 n"""

    low: float | np.ndarray = 0.0
    high: float | np.ndarray = 1.0
    margin: float = 1e-6
    xtol: float = 1e-10
    ftol: float = 1e-10
    by_jacobian: bool = False
    try_ends: bool = False
    barrier: float | None = None
    most: int | None = None

    def inside(self, start: np.ndarray) -> np.ndarray:
        """Start (n,) moved inside the bounds by the margin."""
        low, high, span = self.bounds(len(start))
        return np.clip(start, low + self.margin * span, high - self.margin * span)

    def bounds(self, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Bounds (n,) of n unknowns and their distance (n,), 0 where one is infinite."""
        low, high = (np.broadcast_to(np.asarray(bound, float), n) for bound in (self.low, self.high))
        return low, high, np.where(np.isfinite(high - low), high - low, 0.0)


@dataclass(frozen=True)
class FitResult:
    """The result of a search.

    start:   (n,) unknowns at first
    u:       (n,) unknowns of the least cost that was seen
    cost:    half of the sum of squares there, inf where nothing was evaluated
    history: (k, n) unknowns of every evaluation
    costs:   (k,) of every evaluation
    failure: why the search ended without an answer, None where it has one
    seconds: of CPU time"""

    start: np.ndarray
    u: np.ndarray
    cost: float
    history: np.ndarray
    costs: np.ndarray
    failure: str | None
    seconds: float


def fit(problem: Problem, start: np.ndarray, search: FitSettings) -> FitResult:
    """Least squares from a start (n,). NumericalError where a search with a barrier finds no answer at its start, or no
    Jacobian."""
    begin, failure = time.process_time(), None
    inside = search.inside(start)
    evaluations = _Evaluations(problem, search.barrier)
    if search.barrier is not None:
        evaluations.residuals(inside)
    try:
        least_squares(
            evaluations.residuals, inside, evaluations.jacobian, bounds=(search.low, search.high),
            x_scale="jac" if search.by_jacobian else 1.0,
            xtol=search.xtol, ftol=search.ftol, gtol=search.ftol, max_nfev=search.most,
        )  # fmt: skip
        if search.try_ends:
            _try_ends(evaluations, search)
    except NumericalError as error:
        if search.barrier is not None:
            raise
        failure = str(error)
    u, cost = evaluations.best if evaluations.costs else (inside, np.inf)
    history = np.array(evaluations.history).reshape(-1, len(start))
    return FitResult(start, u, cost, history, np.array(evaluations.costs), failure, time.process_time() - begin)


def best_of(fits: Sequence[FitResult], what: str = "the fit") -> FitResult:
    """The fit of least cost; what: it is called. NumericalError where none came to an answer."""
    answered = [candidate for candidate in fits if candidate.failure is None]
    if not answered:
        raise NumericalError(
            f"{what} failed from every start: {fits[0].failure}",
            do="choose starts nearer to the answer, or narrow the ranges",
        )
    return min(answered, key=lambda candidate: candidate.cost)


def spread_starts(count: int, n: int) -> np.ndarray:
    """Starts (count, n) in [0, 1]: the middle, then Halton points."""
    return np.vstack([np.full((1, n), 0.5), qmc.Halton(n, scramble=False).random(count)[1:]])[:count]


def _try_ends(evaluations: "_Evaluations", search: FitSettings) -> None:
    near, _ = evaluations.best
    low, high, span = search.bounds(len(near))
    ends = np.where(near - low < _END * span, low, np.where(high - near < _END * span, high, near))
    if not np.array_equal(ends, near):
        evaluations.residuals(ends)


class _Evaluations:
    """Evaluates a problem for scipy, which asks for residuals and Jacobian apart; remembers the last and the course."""

    def __init__(self, problem: Problem, barrier: float | None):
        self._problem, self._barrier = problem, barrier
        self.history: list[np.ndarray] = []
        self.costs: list[float] = []

    @property
    def best(self) -> tuple[np.ndarray, float]:
        """Unknowns (n,) of the least cost so far, and the cost."""
        index = int(np.argmin(self.costs))
        return self.history[index], self.costs[index]

    def residuals(self, u: np.ndarray) -> np.ndarray:
        """Residuals (n_r,) at u (n,), or the barrier."""
        if not self._is_last(u):
            try:
                self._evaluate(u, with_jacobian=False)
            except NumericalError:
                if self._barrier is None or not self.costs:
                    raise
                return np.full(len(self._residuals), self._barrier)
        return self._residuals

    def jacobian(self, u: np.ndarray) -> np.ndarray:
        """Jacobian (n_r, n) at u (n,)."""
        if not self._is_last(u) or self._jacobian is None:
            self._evaluate(u, with_jacobian=True)
        return self._jacobian

    def _is_last(self, u: np.ndarray) -> bool:
        return bool(self.history) and np.array_equal(u, self.history[-1])

    def _evaluate(self, u: np.ndarray, with_jacobian: bool) -> None:
        self._residuals, self._jacobian = self._problem(u, with_jacobian)
        if not self._is_last(u):
            self.history.append(u.copy())
            self.costs.append(0.5 * float(self._residuals @ self._residuals))
