"""Maximum a posteriori of the unknowns of robot and rig, and how well they are known.

Least squares of (y - measured) / s, of z where something is known of it, and of d / d_sd. The scatter s, which no
unknown explains, is what the fit leaves (scatter.py), in turns with the fit. Covariance: s^2 included, (J^T J)^-1 of
all rows."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from cfem.cases.rig import Rig, Seen
from cfem.cases.scatter import Linear, Scatter, estimate
from cfem.cases.table import Cases
from cfem.core.errors import InputError, NumericalError

_ROUNDS = 6  # of scatter and fit in turns
_SETTLED = 0.02
_MARGIN = 0.01  # of its range, by which each unknown starts inside


@dataclass(frozen=True)
class CaseFit:
    """z (n_z,), d (n_d,) mm; covariance (n, n) of both; scatter; free: numbers of the unknowns that the measurements
    tell, the trace of the hat matrix; cost: of the posterior, halved; seen: at the answer; residuals (m, k, 3) mm
    computed less measured, nan where not measured; linear: the fit near its answer."""

    z: np.ndarray
    d: np.ndarray
    covariance: np.ndarray
    scatter: Scatter
    free: float
    cost: float
    seen: Seen
    residuals: np.ndarray
    linear: Linear

    @property
    def count(self) -> int:
        """Numbers measured."""
        return int(np.isfinite(self.residuals).sum())


def fit_cases(
    rig: Rig, cases: Cases, scatter: Scatter, start: CaseFit | None = None, fixed_scatter: bool = False
) -> CaseFit:
    """InputError where nothing was measured, NumericalError where no equilibrium is found near the start."""
    if not np.isfinite(cases.target).any():
        raise InputError("no case has a marker that was measured", do="give the places of the markers in the table")
    n_z = len(rig.unknowns)
    at = np.zeros(n_z + rig.n_d) if start is None else np.concatenate([start.z, start.d])
    moved = rig.see(cases, at[:n_z], at[n_z:], slopes=False).moved
    for _ in range(1 if fixed_scatter else _ROUNDS):
        found = _at_scatter(rig, cases, scatter, moved, at)
        if fixed_scatter:
            return found
        before, scatter = np.sqrt(scatter.variance(moved)), estimate(found.linear, scatter)
        at, moved = np.concatenate([found.z, found.d]), found.seen.moved
        if (np.abs(np.sqrt(scatter.variance(moved)) - before) <= _SETTLED * before).all():
            break
    return replace(found, scatter=scatter)


def _at_scatter(rig: Rig, cases: Cases, scatter: Scatter, moved: np.ndarray, at: np.ndarray) -> CaseFit:
    """moved: (m, k) mm about which each marker moves, for its scatter."""
    n_z, target = len(rig.unknowns), cases.target
    mask = np.isfinite(target)
    sd = np.broadcast_to(np.sqrt(scatter.variance(moved))[..., None], target.shape)[mask]
    prior = np.concatenate([[float(one.known) for one in rig.unknowns], 1 / rig.d_sd])
    bounds = np.array([one.bounds for one in rig.unknowns] + [(-np.inf, np.inf)] * rig.n_d).reshape(-1, 2)
    last: dict[bytes, tuple] = {}

    def evaluate(u: np.ndarray, slopes: bool) -> tuple[np.ndarray, np.ndarray, Seen]:
        key = u.tobytes()
        if key not in last or (slopes and not last[key][3]):
            seen = rig.see(cases, u[:n_z], u[n_z:], slopes)
            r = np.concatenate([(seen.y - target)[mask] / sd, prior * u])
            J = np.vstack([np.concatenate([seen.by_z, seen.by_d], axis=3)[mask] / sd[:, None], np.diag(prior)])
            last.clear()
            last[key] = r, J, seen, slopes
        return last[key][:3]

    def residuals(u: np.ndarray) -> np.ndarray:
        try:
            return evaluate(u, False)[0]
        except NumericalError:
            return np.full(int(mask.sum()) + len(u), 1e3)  # no equilibrium there: the search turns back

    # at an end of its range a number would cut the steps of all others short
    margin = np.where(np.isfinite(bounds[:, 1]), _MARGIN * (bounds[:, 1] - bounds[:, 0]), 0.0)
    inside = np.clip(at, bounds[:, 0] + margin, bounds[:, 1] - margin)
    evaluate(inside, False)  # a failure at the start is told
    found = least_squares(
        residuals, inside, lambda u: evaluate(u, True)[1], bounds=bounds.T, x_scale="jac", xtol=1e-6, ftol=1e-8
    )
    r, J, seen = evaluate(found.x, True)
    n = int(mask.sum())
    H = J.T @ J
    covariance = np.linalg.pinv(H, rcond=1e-12, hermitian=True)
    free = float(np.einsum("ij,jk,ik->", J[:n], covariance, J[:n]))
    left = np.where(mask, seen.y - target, np.nan)
    ways = np.broadcast_to(seen.moved[..., None], target.shape)[mask]
    linear = Linear(r[:n] * sd, J[:n] * sd[:, None], found.x, prior, ways)
    return CaseFit(found.x[:n_z], found.x[n_z:], covariance, scatter, free, float(r @ r) / 2, seen, left, linear)
