"""How well the parameters are known: linearised covariance, and the profile of the likelihood.

With residuals r in units of their noise and J = dr/dz at the minimum, cov(z) = s^2 (J^T J)^-1, s^2 = |r|^2 / (n_r - n)
where the noise is not known, and quantiles of Student's t of n_r - n degrees of freedom; where it is, s = 1 and the
quantiles are normal, unless the fit leaves significantly more than the noise (chi-squared test): then s again. A
profile goes along one parameter, all others fitted again, until |r|^2 has grown by the quantile's square times s^2
(Bates and Watts, Nonlinear Regression Analysis, 1988, chapters 2 and 6)."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq, least_squares
from scipy.stats import chi2, norm, t

from cfem.calibrate.fit import Problem
from cfem.core.errors import NumericalError

SIGNIFICANT = 1e-3  # probability under the stated noise below which the residuals are taken for more than noise
RANK = 1e-8  # of the largest singular value: directions below move nothing that was measured


@dataclass(frozen=True)
class Spread:
    """n parameters from n_r residuals. scale: s; quantile: of the confidence asked for; chance: of residuals as large
    as these, were they noise alone, None where the noise is not known; covariance: (n, n) of z, None where the number
    of measurements leaves nothing to tell it from; deviations: (n,) standard deviations, inf where not determined."""

    degrees: int
    scale: float
    quantile: float
    chance: float | None
    covariance: np.ndarray | None
    deviations: np.ndarray

    @property
    def correlation(self) -> np.ndarray | None:
        if self.covariance is None:
            return None
        size = np.sqrt(np.diag(self.covariance))
        size = np.where(size > 0, size, 1.0)
        return self.covariance / np.outer(size, size)


def spread_of(residuals: np.ndarray, jacobian: np.ndarray, known: bool, confidence: float) -> Spread:
    n_r, n = jacobian.shape
    degrees, total = n_r - n, float(residuals @ residuals)
    tail = 0.5 + confidence / 2
    chance = float(chi2.sf(total, degrees)) if known and degrees > 0 else None
    if degrees <= 0 and not known:
        return Spread(degrees, np.nan, np.nan, None, None, np.full(n, np.inf))
    estimated = not known or (chance is not None and chance < SIGNIFICANT)
    scale = np.sqrt(total / degrees) if estimated else 1.0
    quantile = float(t.ppf(tail, degrees) if estimated else norm.ppf(tail))
    _, S, Vt = np.linalg.svd(jacobian, full_matrices=False)
    seen = RANK * S.max(initial=0.0) < S if S.max(initial=0.0) > 0 else np.zeros(len(S), dtype=bool)
    inverse = (Vt[seen].T / S[seen] ** 2) @ Vt[seen]
    # what lies in a direction that nothing measures is not determined at all
    blind = np.ones(n) - (Vt[seen] ** 2).sum(axis=0)
    covariance = scale**2 * inverse
    deviations = np.where(blind > 1e-12, np.inf, np.sqrt(np.diag(covariance)))
    return Spread(degrees, scale, quantile, chance, covariance, deviations)


def profile(problem: Problem, z: np.ndarray, index: int, spread: Spread) -> tuple[float | None, float | None]:
    """Ends of the interval of z[index], None where it reaches an end of the range before the likelihood has fallen
    enough, or cannot be followed."""
    others = np.arange(len(z)) != index
    residuals = problem(z)[0]
    allowed = float(residuals @ residuals) + (spread.quantile * spread.scale) ** 2
    warm = {0.0: z[others]}

    def excess(away: float) -> float:
        near = warm[min(warm, key=lambda known: abs(known - away))]

        def at(rest: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            full = np.empty_like(z)
            full[index], full[others] = z[index] + away, rest
            r, J = problem(full)
            return r, J[:, others]

        if not others.any():
            r = at(near)[0]
            return float(r @ r) - allowed
        start = np.clip(near, 1e-9, 1 - 1e-9)
        found = least_squares(lambda v: at(v)[0], start, lambda v: at(v)[1], bounds=(0, 1), xtol=1e-10, ftol=1e-10)
        warm[away] = found.x
        return 2 * found.cost - allowed

    def end(sign: int) -> float | None:
        room = 1 - z[index] if sign > 0 else z[index]
        width = min(spread.quantile * spread.deviations[index], room)
        try:
            while True:
                if width <= 0:
                    return None
                if excess(sign * width) > 0:
                    tolerance = 1e-4 * width
                    return z[index] + brentq(excess, 0.0, sign * width, xtol=tolerance, rtol=1e-6)
                if width >= room:
                    return None
                width = min(1.6 * width, room)
        except (NumericalError, ValueError):
            return None

    return end(-1), end(1)
