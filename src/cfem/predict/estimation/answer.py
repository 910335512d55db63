"""The estimate of one frame."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cfem.predict.estimation.fit import EstimateStatus


@dataclass(frozen=True)
class Estimate:
    """The state of a robot at one frame.

    delta_a: (n_a,) mm of the actuators
    loads: (n_w,) N on the chosen rows
    covariance: (n_a + n_w, n_a + n_w) of delta_a, then the loads
    rows: (k,) mm of the skin's modes
    delta_e: (n_e,) mm of the effectors
    outliers: numbers of markers that do not fit
    unseen: names of unknowns that the measurements do not observe
    noise: root mean square of the residuals of the other markers over their standard deviation, about 1 or less where
        all is as assumed
    innovation: normalised square of the innovation, and its degrees of freedom, which is its mean where all is as
        assumed
    """

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
        """Standard deviations (n_a + n_w,) of the unknowns."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def converged(self) -> bool:
        return self.status is EstimateStatus.CONVERGED


def innovation_ratio(innovations: Sequence[tuple[float, int]]) -> float | None:
    """Mean square of the innovations over what was expected, 1 where all is as assumed; None without frames."""
    squares = [square for square, numbers in innovations if numbers > 0]
    count = sum(numbers for _, numbers in innovations if numbers > 0)
    return float(sum(squares) / count) if count else None
