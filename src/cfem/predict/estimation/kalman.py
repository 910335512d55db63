"""The steps that all filters share; a filter adds its model: how the state moves, and what a sample shows of it.

With the state x of mean m and covariance P, a step whose slope by x is F and whose noise has the covariance Q gives

    prediction    m' = f(m)    P' = F P F^T + Q

and a sample y = h(x) + noise of covariance R, with H the slope of h, gives

    update    min over x of |P'^-1/2 (x - m')|^2 + |R^-1/2 (y - h(x))|^2

by iterations that linearise h again where they lead (the iterated extended Kalman filter: Bell and Cathey, IEEE Trans.
Automatic Control 38, 1993). Many rows of few unknowns, of which some may be wrong, take the normal equations, damped
(`cfem.predict.estimation.fit`). Few rows, each dear, or a singular P' take the gain P' H^T (H P' H^T + R)^-1 (Anderson
and Moore, *Optimal Filtering*, 1979, chapter 3; here). The least value of the sum is the normalised innovation, by
which the gate judges the sample (`cfem.predict.estimation.gate`)."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np

from cfem.predict.estimation.fit import Prior, Search
from cfem.predict.estimation.gate import Gate, SampleVerdict

FLOOR = 1e-18  # least variance in a root: of numbers that are known exactly
RIDGE = 1e-12  # added to a correlation matrix, so that it has a Cholesky factor


@dataclass(frozen=True)
class Gaussian:
    """A state's distribution.

    mean: (n,)
    covariance: (n, n), may be singular
    """

    mean: np.ndarray
    covariance: np.ndarray

    @property
    def prior(self) -> Prior:
        """The distribution as residuals of a least-squares problem."""
        return Prior(self.mean, information_root(self.covariance))

    def predicted(self, mean: np.ndarray, F: np.ndarray, Q: np.ndarray) -> "Gaussian":
        """The distribution after a step to `mean` (n,) with the slope F (n, n) and noise of covariance Q (n, n)."""
        return Gaussian(mean, F @ self.covariance @ F.T + Q)

    def updated(self, H: np.ndarray, missed: np.ndarray, R: np.ndarray) -> "Update":
        """The update by rows that are linear. The covariance may be singular.

        missed (k,): what the sample showed beyond what was expected; H (k, n): its slope; R (k, k): its noise."""
        HP = H @ self.covariance
        solved = np.linalg.solve(HP @ H.T + R, np.column_stack([HP, missed]))
        gain = solved[:, :-1].T
        return Update(self._after(self.mean + gain @ missed, gain, H, R), float(missed @ solved[:, -1]), len(missed))

    def iterated(
        self,
        measured: np.ndarray,
        expected: Callable[[np.ndarray], np.ndarray],
        slope: Callable[[np.ndarray], np.ndarray],
        R: np.ndarray,
        search: Search,
    ) -> "Update":
        """The update by measured (k,) with noise R (k, k), where expected (k,) = h(x) is not linear.

        slope(x): (k, n) of h, asked at each x right after expected(x); search: bounds and end of the iterations."""
        x, missed = self.mean, measured - expected(self.mean)
        for _ in range(search.iterations):
            H = slope(x)
            HP = H @ self.covariance
            gain = np.linalg.solve(HP @ H.T + R, HP).T
            new = search.bounded(self.mean + gain @ (missed - H @ (self.mean - x)))
            settled = np.abs((new - x) / search.scale).max() < search.tolerance
            x, missed = new, measured - expected(new)
            if settled:
                break
        away = information_root(self.covariance) @ (x - self.mean)
        square = float(missed @ np.linalg.solve(R, missed) + away @ away)
        return Update(self._after(x, gain, H, R), square, len(missed))

    def _after(self, mean: np.ndarray, gain: np.ndarray, H: np.ndarray, R: np.ndarray) -> "Gaussian":
        """The distribution about a new mean. Joseph's form keeps the covariance positive whatever rounding does."""
        keep = np.eye(len(mean)) - gain @ H
        P = keep @ self.covariance @ keep.T + gain @ R @ gain.T
        return Gaussian(mean, (P + P.T) / 2)

    def with_part(self, part: np.ndarray, posterior: "Gaussian") -> "Gaussian":
        """The distribution once the numbers `part` (k,) of the state have the distribution `posterior`.

        The rest follows by its regression on the part: samples that show the part alone say no more of it."""
        rest = np.setdiff1d(np.arange(len(self.mean)), part)
        root = information_root(self.covariance[np.ix_(part, part)])
        regression = self.covariance[np.ix_(rest, part)] @ (root.T @ root)
        mean, covariance = self.mean.copy(), self.covariance.copy()
        mean[part] = posterior.mean
        mean[rest] += regression @ (posterior.mean - self.mean[part])
        across = regression @ posterior.covariance
        covariance[np.ix_(part, part)] = posterior.covariance
        covariance[np.ix_(rest, part)], covariance[np.ix_(part, rest)] = across, across.T
        gained = posterior.covariance - self.covariance[np.ix_(part, part)]
        covariance[np.ix_(rest, rest)] += regression @ gained @ regression.T
        return Gaussian(mean, (covariance + covariance.T) / 2)


def information_root(P: np.ndarray) -> np.ndarray:
    """Matrix (n, n) whose product with an error of covariance P (n, n) has unit covariance, whatever the units."""
    size = np.sqrt(np.maximum(np.diag(P), FLOOR))
    lower = np.linalg.cholesky(P / np.outer(size, size) + RIDGE * np.eye(len(P)))
    return np.linalg.solve(lower, np.diag(1 / size))


@dataclass(frozen=True)
class Update:
    """The distribution after a sample.

    posterior: of the state
    square: normalised square of the innovation; negative or nan where the covariance before was not positive
    numbers: how many were measured
    """

    posterior: Gaussian
    square: float
    numbers: int

    @property
    def innovation(self) -> tuple[float, int]:
        """Square and number of measurements for the gate, to which a negative square says that the filter is lost."""
        return self.square if self.square >= 0 else -np.inf, self.numbers


class UpdateResult(Protocol):
    """The result of an update."""

    @property
    def innovation(self) -> tuple[float, int]:
        """The normalised square of the innovation, and the degrees of freedom of its chi-squared distribution."""
        ...


Belief = TypeVar("Belief")
Corrected = TypeVar("Corrected", bound=UpdateResult)


def gated_update(
    gate: Gate, predicted: Belief | None, first: Callable[[], Belief], update: Callable[[Belief], Corrected]
) -> tuple[Corrected, SampleVerdict]:
    """The update by a sample, and the gate's verdict on the sample.

    predicted: what is known before the sample; where that is None, or the gate asks for a restart, the filter begins
    again with `first()` and this sample. The caller keeps the posterior unless the verdict is REJECTED."""
    if predicted is not None:
        corrected = update(predicted)
        verdict = gate.judge(*corrected.innovation)
        if verdict is not SampleVerdict.RESTART:
            return corrected, verdict
    gate.restart()
    return update(first()), SampleVerdict.ACCEPTED if predicted is None else SampleVerdict.RESTART
