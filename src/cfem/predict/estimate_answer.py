"""What an estimate says."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cfem.predict.estimate_fit import EstimateStatus


@dataclass(frozen=True)
class Estimate:
    """One state. delta_a (n_a,) mm; loads (n_w,) N on the chosen rows; covariance (n_a + n_w, n_a + n_w) of both in
    this order; rows (k,) mm of the skin; delta_e (n_e,) mm; outliers: numbers of markers
    that do not fit; unseen: names of unknowns that the measurements do not tell; noise: root mean square of the
    residuals of the other markers over their standard deviation, about 1 or less where all is as assumed; innovation:
    the square of what the frame missed of what was known before it, over its covariance, and of how many numbers, which
    is its mean where all is as assumed."""

    status: EstimateStatus
    delta_a: np.ndarray
    loads: np.ndarray
    covariance: np.ndarray
    rows: np.ndarray
    delta_e: np.ndarray
    outliers: tuple[int, ...]
    unseen: tuple[str, ...]
    noise: float
    iterations: int
    innovation: tuple[float, int]

    @property
    def deviation(self) -> np.ndarray:
        """(n_a + n_w,) standard deviations."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def judged(self) -> tuple[float, int]:
        """The innovation as a gate is told it (`cfem.predict.gate`): that of a frame without an answer is infinite,
        and of one in which too little is seen there is nothing to judge."""
        if self.status is EstimateStatus.TOO_FEW:
            return 0.0, 0
        good = self.converged and bool(np.isfinite(self.covariance).all())
        return self.innovation if good else (np.inf, 1)

    @property
    def converged(self) -> bool:
        return self.status is EstimateStatus.CONVERGED


def innovation_ratio(innovations: Sequence[tuple[float, int]]) -> float | None:
    """The mean square of what frames missed over what was expected, 1 where all is as assumed; None of no frames."""
    squares = [square for square, numbers in innovations if numbers > 0]
    count = sum(numbers for _, numbers in innovations if numbers > 0)
    return float(sum(squares) / count) if count else None
