"""How well a fit knows its unknowns: linearised covariance, intervals, and the profile of the likelihood.

With residuals r in units of their noise and J = dr/du at the minimum, cov(u) = s^2 (J^T J)^-1, s^2 = |r|^2 / (n_r - n)
where the noise is not known, and quantiles of Student's t of n_r - n degrees of freedom; where it is, s = 1 and the
quantiles are normal, unless the fit leaves significantly more than the noise (chi-squared test): then s again. A
profile goes along one unknown, all others fitted again, until |r|^2 has grown by the quantile's square times s^2
(Bates and Watts, Nonlinear Regression Analysis, 1988, chapters 2 and 6)."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.stats import chi2, norm, t

from cfem.core.errors import NumericalError
from cfem.parametric.least_squares import FitSettings, Problem, fit

RANK = 1e-8  # share of the largest singular value below which a direction moves nothing that was measured
_SIGNIFICANT = 1e-3  # probability under the stated noise below which the residuals are taken for more than noise
_BLIND = 1e-12  # share of a direction's square that may lie in unmeasured ones, by rounding
_PROFILE = FitSettings(margin=1e-9)


@dataclass(frozen=True)
class Information:
    """Information that residuals hold on n unknowns, near the minimum.

    singular_values: (n,) of J, largest first
    inverse:         (n, n) of J^T J, over the directions that are measured
    unmeasured:      (k, n) orthonormal directions that move no residual"""

    singular_values: np.ndarray
    inverse: np.ndarray
    unmeasured: np.ndarray

    @property
    def rank(self) -> int:
        """Number of directions that are measured."""
        return len(self.singular_values) - len(self.unmeasured)

    def deviation(self, slopes: np.ndarray) -> np.ndarray:
        """Standard deviations (...,) of linear functions of the unknowns, slopes (..., n), for residuals of variance
        one; inf where an unmeasured direction moves the function."""
        blind = ((slopes @ self.unmeasured.T) ** 2).sum(axis=-1) > _BLIND * (slopes**2).sum(axis=-1)
        variance = np.einsum("...i,ij,...j->...", slopes, self.inverse, slopes)
        return np.where(blind, np.inf, np.sqrt(np.maximum(variance, 0.0)))


def information(jacobian: np.ndarray, rank: float = RANK, unmeasured: np.ndarray | None = None) -> Information:
    """The information of residuals with a Jacobian (n_r, n).

    rank:       share of the largest singular value that a measured direction exceeds
    unmeasured: (k, n) directions of which it is known that they move no residual; found unless given"""
    n = jacobian.shape[1]
    if unmeasured is not None:
        blind = np.linalg.qr(unmeasured.T)[0]
        jacobian = jacobian - jacobian @ blind @ blind.T
    _, values, directions = np.linalg.svd(np.linalg.qr(jacobian, mode="r"))
    singular_values = np.zeros(n)
    singular_values[: len(values)] = values
    measured = singular_values > rank * singular_values.max(initial=0.0)
    if unmeasured is not None:
        measured = np.arange(n) < n - len(unmeasured)
    seen = directions[measured]
    inverse = (seen.T / singular_values[measured] ** 2) @ seen
    return Information(singular_values, inverse, directions[~measured])


@dataclass(frozen=True)
class Uncertainty:
    """Uncertainty of n unknowns fitted to n_r residuals. Scale and quantile are nan where nothing tells the noise: it
    was not stated, and the residuals are no more than the unknowns.

    information: what the residuals tell
    degrees:     n_r - n
    scale:       s, of the residuals
    quantile:    of the confidence that was asked for
    chance:      of residuals as large as these, were they noise alone; None where the noise is not known"""

    information: Information
    degrees: int
    scale: float
    quantile: float
    chance: float | None

    @property
    def covariance(self) -> np.ndarray | None:
        """Covariance (n, n) of the unknowns, None where the number of residuals leaves nothing to tell it from."""
        return self.scale**2 * self.information.inverse if np.isfinite(self.scale) else None

    @property
    def deviations(self) -> np.ndarray:
        """Standard deviations (n,) of the unknowns, inf where not determined."""
        n = len(self.information.inverse)
        return self.scale * self.information.deviation(np.eye(n)) if np.isfinite(self.scale) else np.full(n, np.inf)

    @property
    def correlation(self) -> np.ndarray | None:
        """Correlation (n, n) of the unknowns, None without a covariance."""
        return None if self.covariance is None else correlation(self.covariance)

    def half(self, slopes: np.ndarray) -> np.ndarray:
        """Half widths (...,) of the intervals of linear functions of the unknowns, slopes (..., n); inf where not
        determined."""
        if not np.isfinite(self.scale):
            return np.full(np.shape(slopes)[:-1], np.inf)
        return self.quantile * self.scale * self.information.deviation(slopes)


def uncertainty(
    residuals: np.ndarray,
    jacobian: np.ndarray,
    known: bool,
    confidence: float,
    shared: float = 0.0,
    unmeasured: np.ndarray | None = None,
) -> Uncertainty:
    """Uncertainty of the minimum of residuals (n_r,) with Jacobian (n_r, n).

    known:  whether the residuals are in units of a noise that somebody stated
    shared: correlation of neighbouring residuals: n_r of them count as n_r (1 - shared) / (1 + shared)
    unmeasured: as of `information`"""
    n_r, n = jacobian.shape
    degrees, square = n_r - n, float(residuals @ residuals)
    known_directions = information(jacobian, unmeasured=unmeasured)
    if degrees <= 0 and not known:
        return Uncertainty(known_directions, degrees, np.nan, np.nan, None)
    chance = float(chi2.sf(square, degrees)) if known and degrees > 0 else None
    estimated = not known or (chance is not None and chance < _SIGNIFICANT)
    scale = np.sqrt(square / degrees * (1 + shared) / (1 - shared)) if estimated else 1.0
    tail = 0.5 + confidence / 2
    quantile = float(t.ppf(tail, degrees) if estimated else norm.ppf(tail))
    return Uncertainty(known_directions, degrees, scale, quantile, chance)


def correlation(covariance: np.ndarray) -> np.ndarray:
    """Correlation (n, n) of a covariance (n, n), zero where a variance is."""
    size = np.sqrt(np.diag(covariance))
    size = np.where(size > 0, size, 1.0)
    return covariance / np.outer(size, size)


def profile(problem: Problem, z: np.ndarray, index: int, known: Uncertainty) -> tuple[float | None, float | None]:
    """Ends of the interval of z[index] in [0, 1] by the profile of the likelihood, None where it reaches an end of the
    range before the likelihood has fallen enough, or cannot be followed."""
    rest = np.arange(len(z)) != index
    residuals, _ = problem(z, False)
    allowed = float(residuals @ residuals) + (known.quantile * known.scale) ** 2
    fitted_rest = {0.0: z[rest]}

    def excess(shift: float) -> float:
        """Sum of squares beyond the allowed one, z[index] shifted and all others fitted again."""

        def shifted(others: np.ndarray, with_jacobian: bool) -> tuple[np.ndarray, np.ndarray | None]:
            full = np.empty_like(z)
            full[index], full[rest] = z[index] + shift, others
            r, J = problem(full, with_jacobian)
            return r, None if J is None else J[:, rest]

        start = fitted_rest[min(fitted_rest, key=lambda tried: abs(tried - shift))]
        if not rest.any():
            r, _ = shifted(start, False)
            return float(r @ r) - allowed
        answer = fit(shifted, start, _PROFILE)
        if answer.failure is not None:
            raise NumericalError(answer.failure)
        fitted_rest[shift] = answer.u
        return 2 * answer.cost - allowed

    def end(sign: int) -> float | None:
        """End of the interval on one side: the shift is widened until the excess is positive, then bisected."""
        room = 1 - z[index] if sign > 0 else z[index]
        width = min(known.quantile * known.deviations[index], room)
        try:
            while width > 0:
                if excess(sign * width) > 0:
                    return z[index] + brentq(excess, 0.0, sign * width, xtol=1e-4 * width, rtol=1e-6)
                if width >= room:
                    return None
                width = min(1.6 * width, room)
        except (NumericalError, ValueError):
            return None  # no fit, or none of one sign, that far out: the end is not known
        return None

    return end(-1), end(1)
