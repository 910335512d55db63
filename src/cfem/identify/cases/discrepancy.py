"""Prior of what the model lacks (Kennedy and O'Hagan, J. R. Stat. Soc. B 63, 2001).

In the scene's frame, a marker is beside where the model has it by delta = sum_b phi_b(f / largest) w_b, a polynomial of
the forces (`cfem.condensed.discrepancy`). Each w_b is normal with mean 0 and the standard deviation share * spread of
its marker, spread the root mean square of how far the measurements have it from its mean (or from rest). Parameters and
w are estimated together, and the share from what the fit leaves (fit.py)."""

from dataclasses import dataclass

import numpy as np

from cfem.condensed.discrepancy import features, terms_of
from cfem.identify.cases.table import Cases


@dataclass(frozen=True)
class DiscrepancyPrior:
    """The prior of what the model lacks.

    largest: (n_a,) N or MPa, largest force of each actuator in the calibration
    spread:  (k,) mm of each marker
    share:   standard deviation of each w over the spread of its marker"""

    largest: np.ndarray
    spread: np.ndarray
    share: float = 0.05

    @property
    def terms(self) -> list[tuple[int, ...]]:
        """Actuators whose forces each feature multiplies."""
        return terms_of(len(self.largest))

    def features(self, forces: np.ndarray) -> np.ndarray:
        """Features (m, n_b) of forces (m, n_a), constant beyond the largest force of the calibration."""
        return features(forces / self.largest)

    @property
    def sd(self) -> np.ndarray:
        """Standard deviation (k,) mm of each w of a marker."""
        return self.share * self.spread


def discrepancy_of(cases: Cases) -> DiscrepancyPrior:
    """The prior before any fit, from the range of forces and places of a calibration."""
    target = cases.target if cases.rest is not None else cases.target - np.nanmean(cases.target, axis=0)
    spread = np.sqrt(np.nanmean((target**2).sum(axis=2), axis=0))
    largest = np.abs(cases.forces).max(axis=0)
    return DiscrepancyPrior(np.where(largest > 0, largest, 1.0), spread)
