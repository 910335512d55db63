"""Each load case as a fit to the others predicts it: how far a calibration can be trusted."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import t

from cfem.core.errors import NumericalError
from cfem.identify.cases.fit import CaseFit, fit_cases
from cfem.identify.cases.rig import Rig
from cfem.identify.cases.robots import Pose
from cfem.identify.cases.table import Cases
from cfem.identify.fit.prediction_intervals import degrees_of_freedom, half_and_radius, inflation_of, share_covered


@dataclass(frozen=True)
class LeftOut:
    """Errors of m cases, each predicted by the others.

    residuals:  (m, k, 3) mm computed less measured, nan where not measured
    covariance: (m, k, 3, 3) mm^2 of parameters and scatter together
    failed:     names of cases without which the others could not be fitted
    poses:      of the robot, None in those"""

    residuals: np.ndarray
    covariance: np.ndarray
    failed: tuple[str, ...]
    poses: tuple[Pose | None, ...] = ()

    @property
    def distance(self) -> np.ndarray:
        """Distances (m, k) mm of the markers from their predictions."""
        return np.linalg.norm(self.residuals, axis=2)

    @property
    def _ratio_by_case(self) -> np.ndarray:
        """Mean squares (m,) of the errors of each case in units of their sd, nan where none is known."""
        squares = self.residuals**2 / np.einsum("mkii->mki", self.covariance)
        known = np.isfinite(squares)
        counts = known.sum(axis=(1, 2))
        return np.where(counts > 0, np.where(known, squares, 0.0).sum(axis=(1, 2)) / np.maximum(counts, 1), np.nan)

    @property
    def ratios(self) -> np.ndarray:
        """Mean squares (m',) of the errors of the cases that the others predict."""
        return self._ratio_by_case[np.isfinite(self._ratio_by_case)]

    @property
    def inflation(self) -> float:
        """Ratio of the errors of left-out cases to those that the fit expects, at least 1."""
        return inflation_of(self.ratios)

    def degrees(self, most: float) -> float:
        """Degrees of freedom of the inflation; most: those of the scatter."""
        return degrees_of_freedom(self.ratios, most)

    def by_others(self, most: float) -> tuple[np.ndarray, np.ndarray]:
        """Inflation (m,) and degrees of freedom (m,) of each case as the other cases tell them, nan where there are
        none."""
        ratios = self._ratio_by_case
        inflation, degrees = np.full((2, len(ratios)), np.nan)
        for i in np.flatnonzero(np.isfinite(ratios)):
            rest = np.delete(ratios, i)
            rest = rest[np.isfinite(rest)]
            if len(rest):
                inflation[i], degrees[i] = inflation_of(rest), degrees_of_freedom(rest, most)
        return inflation, degrees

    def log_density(self, most: float) -> np.ndarray:
        """Logarithm (m, k, 3) of the density 1/mm that the other cases give to each measured coordinate."""
        inflation, degrees = (part[:, None, None] for part in self.by_others(most))
        return t.logpdf(self.residuals, degrees, scale=inflation * np.sqrt(np.einsum("mkii->mki", self.covariance)))

    def covered(self, most: float, confidence: float) -> tuple[float, float]:
        """Share of coordinates of left-out cases within their intervals, and of markers within their radius. The
        inflation of a case is that of the other cases. nan where there are no two."""
        inflation, degrees = self.by_others(most)
        half, radius = np.full_like(self.residuals, np.nan), np.full_like(self.distance, np.nan)
        for i in np.flatnonzero(np.isfinite(self._ratio_by_case)):
            if not np.isfinite(inflation[i]):
                return np.nan, np.nan
            half[i], radius[i] = half_and_radius(self.covariance[i], inflation[i], degrees[i], confidence)
        return share_covered(self.residuals, half, radius)


def leave_one_out(rig: Rig, cases: Cases, fitted: CaseFit) -> LeftOut:
    """Predictions of each case by a fit to the others, at the scatter of the fit to all, from its answer."""
    residuals, failed = np.full(cases.places.shape, np.nan), []
    covariance = np.full((*cases.places.shape, 3), np.nan)
    poses: list[Pose | None] = [None] * len(cases)
    for i in range(len(cases)):
        rest = np.arange(len(cases)) != i
        if not np.isfinite(cases.target[rest]).any():
            failed.append(cases.names[i])
            continue
        try:
            answer = fit_cases(rig, cases.only(rest), fitted.scatter, fitted, fixed_scatter=True)
            seen = rig.see(cases.only(~rest), answer.z, answer.d)
        except NumericalError:
            failed.append(cases.names[i])
            continue
        residuals[i], poses[i] = seen.y[0] - cases.target[i], seen.poses[0]
        covariance[i] = seen.covariance(answer.covariance, fitted.scatter.variance(seen.moved))[0]
    return LeftOut(residuals, covariance, tuple(failed), tuple(poses))
