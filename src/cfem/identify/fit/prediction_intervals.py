"""Intervals of predicted markers, and how much errors of left-out cases widen them.

The variance of a coordinate is inflation^2 C, C = g^T C_u g + s^2: C_u the covariance of all unknowns, g the
prediction's derivative by them, s the scatter that no unknown explains, and the inflation by which errors of left-out
cases are larger than this says. Quantiles are Student's t of the degrees of freedom of the inflation; of the distance
of a marker, those of trace F(h, degrees) with h = trace^2 / trace of the square of its covariance, which has the mean
and the variance of the squared distance (Box, Ann. Math. Stat. 25, 1954)."""

import numpy as np
from scipy.stats import f, t


def half_and_radius(
    C: np.ndarray, inflation: float, degrees: float, confidence: float
) -> tuple[np.ndarray, np.ndarray]:
    """Half of the interval of each coordinate (..., 3) mm of markers with covariance C (..., 3, 3) mm^2, and the
    distance (...,) mm within which each marker lies."""
    sd = inflation * np.sqrt(np.einsum("...ii->...i", C))
    trace, square = np.einsum("...ii->...", C), np.einsum("...ij,...ij->...", C, C)
    h = trace**2 / np.where(square > 0, square, 1.0)
    radius = inflation * np.sqrt(trace * f.ppf(confidence, h, degrees))
    return t_quantile(degrees, confidence) * sd, radius


def share_covered(error: np.ndarray, half: np.ndarray, radius: np.ndarray) -> tuple[float, float]:
    """Share of measured coordinates within their intervals, and of markers within their radius; nan where nothing was
    measured.

    error:  (m, k, 3) mm, nan where not measured
    half:   (m, k, 3) mm of the intervals
    radius: (m, k) mm"""
    distance = np.linalg.norm(error, axis=2)
    inside = (np.abs(error) <= half)[np.isfinite(error)]
    near = (distance <= radius)[np.isfinite(distance)]
    return (float(inside.mean()) if len(inside) else np.nan, float(near.mean()) if len(near) else np.nan)


def t_quantile(degrees: float, confidence: float) -> float:
    """Standard deviations of half of an interval of this confidence."""
    return float(t.ppf(0.5 + confidence / 2, degrees))


def inflation_of(ratios: np.ndarray) -> float:
    """Ratio of errors to those expected, at least 1: the root of the mean of the cases' ratios (m,), each the mean
    square of the case's errors in units of their sd."""
    return max(1.0, float(np.sqrt(ratios.mean()))) if len(ratios) else 1.0


def degrees_of_freedom(ratios: np.ndarray, most: float) -> float:
    """Degrees of freedom of the inflation, between one less than cases and `most`, those of the scatter.

    Where the model lacks something, the errors of a case's markers are correlated, so a case counts as fewer numbers
    than it has. The spread of the cases' ratios tells how few (Satterthwaite, Biometrics Bull. 2, 1946): their mean has
    2 m mean^2 / variance degrees, times (m - 1) / (m + 1), as few cases tell the variance itself."""
    m = len(ratios)
    least = float(max(m - 1, 1))
    if m < 2 or ratios.var(ddof=1) == 0:
        return least
    degrees = 2 * m * ratios.mean() ** 2 / ratios.var(ddof=1) * (m - 1) / (m + 1)
    return float(np.clip(degrees, least, max(most, least)))
