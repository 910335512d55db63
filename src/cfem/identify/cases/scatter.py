"""Scatter: what no unknown explains in a coordinate, and how it grows with the load.

The variance of a coordinate of a marker that has moved by u from where it is without load is

    fixed^2 + (share u)^2 = s^2 (1 - w + w u^2 / mean(u^2))

For each w of a grid, s^2 is what the fit leaves, r V^-1 r / (n_r - n_eff), n_eff the trace of the hat matrix (the
measurements' own share of the unknowns), and the restricted likelihood of s and w tells how much this w is believed
(Patterson and Thompson, Biometrika 58, 1971). The answer is the mean of the variances over w. Where all cases moved by
as much, nothing tells w, and larger loads get a scatter between the same and one in proportion."""

from dataclasses import dataclass

import numpy as np

_GROWTHS = np.linspace(0, 1, 9)  # w
_TURNS = 30
_SETTLED = 1e-3  # relative change of s^2 at which the turns end
_LEAST = 0.3  # share of the degrees of freedom that is left at least to estimate the scatter from


@dataclass(frozen=True)
class Scatter:
    """Standard deviation of a coordinate that no unknown explains.

    fixed: mm
    share: of the distance that a marker has moved"""

    fixed: float
    share: float = 0.0

    def variance(self, moved: np.ndarray) -> np.ndarray:
        """Variance mm^2 of each coordinate of markers that moved so many mm."""
        return self.fixed**2 + (self.share * moved) ** 2


@dataclass(frozen=True)
class Linearised:
    """A fit near its answer.

    r:     (n_r,) mm computed less measured
    J:     (n_r, n) its derivative by the unknowns
    u:     (n,) unknowns, which have a normal prior of sd 1 / prior
    prior: (n,)
    moved: (n_r,) mm by which each coordinate's marker has moved"""

    r: np.ndarray
    J: np.ndarray
    u: np.ndarray
    prior: np.ndarray
    moved: np.ndarray


def estimate_scatter(fitted: Linearised, first: Scatter) -> Scatter:
    """The scatter of all that was measured; first: to start from."""
    square = float((fitted.moved**2).mean())
    likelihoods, fixed, share = [], [], []
    for w in _GROWTHS if square > 0 else [0.0]:
        V = 1 - w + w * fitted.moved**2 / (square or 1.0)
        if V.min() < 1e-6:
            continue  # markers that did not move cannot have scattered in proportion
        s2, likelihood = restricted_likelihood(fitted, V, float((first.variance(fitted.moved) / V).mean()))
        likelihoods.append(likelihood)
        fixed.append(s2 * (1 - w))
        share.append(s2 * w / (square or 1.0))
    weight = np.exp(np.array(likelihoods) - max(likelihoods))
    weight /= weight.sum()
    return Scatter(float(np.sqrt(weight @ fixed)), float(np.sqrt(weight @ share)))


def restricted_likelihood(fitted: Linearised, V: np.ndarray, s2: float) -> tuple[float, float]:
    """Scale s^2 mm^2 of variances in the proportions V (n_r,), by turns from a first s^2, and the logarithm of its
    restricted likelihood."""
    weighted, information = fitted.J.T / V, np.diag(fitted.prior**2)
    step = np.zeros(len(fitted.u))
    for _ in range(_TURNS):
        inverse = np.linalg.pinv(weighted @ fitted.J / s2 + information, rcond=1e-12, hermitian=True)
        step = -inverse @ (weighted @ fitted.r / s2 + fitted.prior**2 * fitted.u)
        residual = fitted.r + fitted.J @ step
        free = float(np.einsum("ij,ji->", inverse, weighted @ fitted.J / s2))
        before, s2 = s2, float((residual**2 / V).sum()) / max(len(V) - free, _LEAST * len(V))
        if abs(s2 - before) <= _SETTLED * before:
            break
    misfit = float((residual**2 / V).sum() / s2 + ((fitted.prior * (fitted.u + step)) ** 2).sum())
    values = np.linalg.eigvalsh(weighted @ fitted.J / s2 + information)
    determinant = np.log(values[values > 1e-12 * values[-1]]).sum()
    return s2, -0.5 * (float(np.log(s2 * V).sum()) + determinant + misfit)
