"""Maximum a posteriori of the unknowns of robot and rig, and how well they are known.

Least squares of (y - measured) / s, of z where something is known of it, and of d / d_sd. The scatter s, which no
unknown explains, is estimated from what the fit leaves (scatter.py), in turns with the fit. Covariance: (J^T J)^-1 of
all rows, s included. A direction that no row measures keeps the variance of z, which is one."""

from dataclasses import dataclass, replace

import numpy as np

from cfem.core.errors import InputError
from cfem.identify.cases.rig import MarkerPredictions, Rig
from cfem.identify.cases.scatter import Linearised, Scatter, estimate_scatter, restricted_likelihood
from cfem.identify.cases.table import Cases
from cfem.identify.fit.criteria import aicc, bic
from cfem.identify.fit.uncertainty import information
from cfem.parametric.least_squares import FitSettings, fit

_ROUNDS = 6  # of scatter and fit in turns
_SETTLED = 0.02  # relative change of the scatter at which the turns end
_SHARES = np.array([0.002, 0.005, 0.01, 0.02, 0.04, 0.08, 0.16, 0.32])  # of a discrepancy
_SHARE_ROUNDS = 5  # of its share and fit in turns
_SHARE_SETTLED = 0.05  # relative change of the share at which these end
_RANK = 1e-6  # share of the largest singular value that a measured direction exceeds
# at an end of its range an unknown would cut the steps of all others short: each starts 1 % of its range inside
_SEARCH = FitSettings(margin=0.01, xtol=1e-6, ftol=1e-8, by_jacobian=True, barrier=1e3)


@dataclass(frozen=True)
class CaseFit:
    """A fit of robot and rig to load cases.

    z, d:       (n_z,) unknowns; (n_d,) mm offsets of markers
    covariance: (n, n) of z and d
    scatter:    that no unknown explains
    free:       number of unknowns that the measurements determine, the trace of the hat matrix
    seen:       predictions at the answer
    residuals:  (m, k, 3) mm computed less measured, nan where not measured
    linear:     the fit near its answer"""

    z: np.ndarray
    d: np.ndarray
    covariance: np.ndarray
    scatter: Scatter
    free: float
    seen: MarkerPredictions
    residuals: np.ndarray
    linear: Linearised

    @property
    def count(self) -> int:
        """Number of measured coordinates."""
        return int(np.isfinite(self.residuals).sum())

    @property
    def u(self) -> np.ndarray:
        """Unknowns and offsets (n,), z and d."""
        return np.concatenate([self.z, self.d])

    @property
    def criteria(self) -> dict[str, float]:
        """AICc and BIC, with `free`, the scatter and its growth as the number of parameters."""
        fitted = self.free + 1 + (self.scatter.share > 0)
        V, r, n = self.scatter.variance(self.linear.moved), self.linear.r, self.count
        deviance = float(np.log(V).sum() + n * np.log((r**2 / V).sum() / n))
        return {"aicc": aicc(deviance, n, fitted), "bic": bic(deviance, n, fitted)}


def fit_cases(
    rig: Rig, cases: Cases, scatter: Scatter, start: CaseFit | None = None, fixed_scatter: bool = False
) -> CaseFit:
    """The unknowns of a rig that fit load cases best. InputError where nothing was measured, NumericalError where no
    equilibrium is found near the start.

    scatter: first guess, kept where `fixed_scatter`
    start:   a fit to begin at; the scene's values unless given"""
    if not np.isfinite(cases.target).any():
        raise InputError("no case has a marker that was measured", do="give the places of the markers in the table")
    n_z = len(rig.unknowns)
    u = np.zeros(n_z + rig.n_d) if start is None else start.u
    moved = rig.see(cases, u[:n_z], u[n_z:], slopes=False).moved
    for _ in range(1 if fixed_scatter else _ROUNDS):
        answer = _at_scatter(rig, cases, scatter, moved, u)
        if fixed_scatter:
            return answer
        before, scatter = np.sqrt(scatter.variance(moved)), estimate_scatter(answer.linear, scatter)
        u, moved = answer.u, answer.seen.moved
        if (np.abs(np.sqrt(scatter.variance(moved)) - before) <= _SETTLED * before).all():
            break
    return replace(answer, scatter=scatter)


def fit_with_discrepancy(rig: Rig, cases: Cases, scatter: Scatter) -> tuple[Rig, CaseFit]:
    """The fit of a rig, in turns with the share of its discrepancy where it has one, and the rig with that share."""
    answer = fit_cases(rig, cases, scatter)
    for _ in range(_SHARE_ROUNDS if rig.discrepancy is not None else 0):
        share = estimate_share(answer, rig)
        settled = abs(share - rig.discrepancy.share) <= _SHARE_SETTLED * rig.discrepancy.share
        rig = rig.with_discrepancy(replace(rig.discrepancy, share=share))
        answer = fit_cases(rig, cases, answer.scatter, answer)
        if settled:
            break
    return rig, answer


def estimate_share(fitted: CaseFit, rig: Rig) -> float:
    """Root of the mean square of the share over a grid, each believed by its restricted likelihood at the fit."""
    linear, n_z = fitted.linear, len(rig.unknowns)
    V = fitted.scatter.variance(linear.moved)
    likelihoods = []
    for share in _SHARES:
        d_sd = rig.with_discrepancy(replace(rig.discrepancy, share=share)).d_sd
        prior = np.concatenate([linear.prior[:n_z], 1 / d_sd])
        at_share = Linearised(linear.r, linear.J, linear.u, prior, linear.moved)
        likelihoods.append(restricted_likelihood(at_share, V, 1.0)[1] + np.log(prior[n_z:]).sum())
    weight = np.exp(np.array(likelihoods) - max(likelihoods))
    return float(np.sqrt(weight @ _SHARES**2 / weight.sum()))


def _at_scatter(rig: Rig, cases: Cases, scatter: Scatter, moved: np.ndarray, start: np.ndarray) -> CaseFit:
    """The fit at a given scatter; moved: (m, k) mm about which each marker moves; start: (n,)."""
    posterior = _Posterior(rig, cases, scatter, moved)
    bounds = [unknown.bounds for unknown in rig.unknowns] + [(-np.inf, np.inf)] * rig.n_d
    low, high = np.array(bounds).reshape(-1, 2).T
    u = fit(posterior, start, replace(_SEARCH, low=low, high=high)).u
    r, J = posterior(u, True)
    seen, mask, n, n_z = posterior.seen, posterior.mask, len(posterior.sd), len(rig.unknowns)
    known = information(J, _RANK)
    covariance = known.inverse + known.unmeasured.T @ known.unmeasured
    free = float(np.einsum("ij,jk,ik->", J[:n], known.inverse, J[:n]))
    residuals = np.where(mask, seen.y - cases.target, np.nan)
    distances = np.broadcast_to(seen.moved[..., None], mask.shape)[mask]
    linear = Linearised(r[:n] * posterior.sd, J[:n] * posterior.sd[:, None], u, posterior.prior, distances)
    return CaseFit(u[:n_z], u[n_z:], covariance, scatter, free, seen, residuals, linear)


class _Posterior:
    """Residuals of the measured coordinates over their standard deviations sd (n_r,), then those of the prior.

    mask:  (m, k, 3) whether each coordinate was measured
    prior: (n,) one over the standard deviation of what is known of each unknown before, 0 where nothing is
    seen:  predictions where it was evaluated last"""

    def __init__(self, rig: Rig, cases: Cases, scatter: Scatter, moved: np.ndarray):
        self._rig, self._cases = rig, cases
        self.mask = np.isfinite(cases.target)
        self.sd = np.broadcast_to(np.sqrt(scatter.variance(moved))[..., None], self.mask.shape)[self.mask]
        self.prior = np.concatenate([[float(unknown.known) for unknown in rig.unknowns], 1 / rig.d_sd])

    def __call__(self, u: np.ndarray, with_jacobian: bool) -> tuple[np.ndarray, np.ndarray | None]:
        n_z = len(self._rig.unknowns)
        self.seen = self._rig.see(self._cases, u[:n_z], u[n_z:], with_jacobian)
        misfit = (self.seen.y - self._cases.target)[self.mask] / self.sd
        residuals = np.concatenate([misfit, self.prior * u])
        if not with_jacobian:
            return residuals, None
        return residuals, np.vstack([self.seen.by_u[self.mask] / self.sd[:, None], np.diag(self.prior)])
