"""Intervals of predicted markers, and how much errors of left-out cases widen them.

The variance of a coordinate is inflation^2 C, C = g^T C_u g + s^2: C_u the covariance of all unknowns of robot and rig,
g the prediction's derivative by them, s the scatter that no unknown explains (scatter.py), and the inflation by which
errors of left-out cases are larger than this says. Quantiles are Student's t of the degrees of freedom of the
inflation; of the distance of a marker, those of trace F(h, degrees) with h = trace^2 / trace of the square of its
covariance, which has the mean and the variance of the squared distance (Box, Ann. Math. Stat. 25, 1954)."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import f, t

from cfem.cases.robots import Posed


def half_and_radius(
    C: np.ndarray, inflation: float, degrees: float, confidence: float
) -> tuple[np.ndarray, np.ndarray]:
    """Of markers with covariance C (..., 3, 3) mm^2: half of the interval of each coordinate (..., 3) mm, and the
    distance (...,) mm within which the marker lies."""
    sd = inflation * np.sqrt(np.einsum("...ii->...i", C))
    trace, square = np.einsum("...ii->...", C), np.einsum("...ij,...ij->...", C, C)
    safe = np.where(square > 0, square, 1.0)
    radius = inflation * np.sqrt(trace * f.ppf(confidence, trace**2 / safe, degrees))
    return float(t.ppf(0.5 + confidence / 2, degrees)) * sd, radius


def inflation(ratios: np.ndarray) -> float:
    """Of mean squares (m,) of each case's errors in units of their sd: the root of their mean, at least 1."""
    return max(1.0, float(np.sqrt(ratios.mean()))) if len(ratios) else 1.0


def degrees_of_freedom(ratios: np.ndarray, most: float) -> float:
    """Of the inflation, between one less than cases and `most`, those of the scatter.

    Where the model lacks something, the errors of a case's markers are correlated, so a case counts as fewer numbers
    than it has. The spread of the cases' ratios tells how few (Satterthwaite, Biometrics Bull. 2, 1946): their mean has
    2 m mean^2 / variance degrees, times (m - 1) / (m + 1), as few cases tell the variance itself."""
    m = len(ratios)
    least = float(max(m - 1, 1))
    if m < 2 or ratios.var(ddof=1) == 0:
        return least
    found = 2 * m * ratios.mean() ** 2 / ratios.var(ddof=1) * (m - 1) / (m + 1)
    return float(np.clip(found, least, max(most, least)))


@dataclass(frozen=True)
class LeftOut:
    """Each case as the others predict it: residuals (m, k, 3) mm, nan where not measured; covariance (m, k, 3, 3) mm^2
    of parameters and scatter together; failed: names of cases that the others could not be fitted without; posed: the
    robot, None in those."""

    residuals: np.ndarray
    covariance: np.ndarray
    failed: tuple[str, ...]
    posed: tuple[Posed | None, ...] = ()

    @property
    def distance(self) -> np.ndarray:
        """(m, k) mm."""
        return np.linalg.norm(self.residuals, axis=2)

    @property
    def _each(self) -> np.ndarray:
        """(m,) mean square of the errors of each case in units of their sd, nan where none is known."""
        squares = self.residuals**2 / np.einsum("mkii->mki", self.covariance)
        told = np.isfinite(squares)
        counts = told.sum(axis=(1, 2))
        return np.where(counts > 0, np.where(told, squares, 0.0).sum(axis=(1, 2)) / np.maximum(counts, 1), np.nan)

    @property
    def ratios(self) -> np.ndarray:
        """(m',) of the cases that the others predict."""
        return self._each[np.isfinite(self._each)]

    @property
    def inflation(self) -> float:
        """How much larger errors of left-out cases are than the fit says of itself."""
        return inflation(self.ratios)

    def degrees(self, most: float) -> float:
        """Of freedom, of the inflation; most: those of the scatter."""
        return degrees_of_freedom(self.ratios, most)

    def covered(self, most: float, confidence: float) -> tuple[float, float]:
        """Share of coordinates of left-out cases within their intervals, and of markers within their radius. The
        inflation of a case is that of the other cases. nan where there are no two."""
        ratios, inside, near = self._each, [], []
        for i in np.flatnonzero(np.isfinite(ratios)):
            others = np.delete(ratios, i)
            others = others[np.isfinite(others)]
            if not len(others):
                return np.nan, np.nan
            degrees = degrees_of_freedom(others, most)
            half, radius = half_and_radius(self.covariance[i], inflation(others), degrees, confidence)
            there, whole = np.isfinite(self.residuals[i]), np.isfinite(self.distance[i])
            inside += list((np.abs(self.residuals[i]) <= half)[there])
            near += list((self.distance[i] <= radius)[whole])
        return (float(np.mean(inside)), float(np.mean(near))) if inside else (np.nan, np.nan)
