"""Which model the measurements support: cases left out one at a time, information criteria, and what cannot be told
apart."""

import numpy as np

from cfem.cases.fit import CaseFit, fit_cases
from cfem.cases.intervals import LeftOut
from cfem.cases.rig import Rig
from cfem.cases.robots import Posed
from cfem.cases.table import Cases
from cfem.core.errors import NumericalError

APART = 0.9  # correlation beyond which two unknowns cannot be told apart
LEARNED = 0.7  # of the prior standard deviation: above it the measurements say little


def leave_one_out(rig: Rig, cases: Cases, whole: CaseFit) -> LeftOut:
    """At the scatter of the whole fit, each from its answer."""
    left, failed = np.full(cases.places.shape, np.nan), []
    covariance = np.full((*cases.places.shape, 3), np.nan)
    posed: list[Posed | None] = [None] * len(cases)
    for i in range(len(cases)):
        others = np.arange(len(cases)) != i
        if not np.isfinite(cases.target[others]).any():
            failed.append(cases.names[i])
            continue
        try:
            found = fit_cases(rig, cases.only(others), whole.scatter, whole, fixed_scatter=True)
            mine = cases.only(~others)
            seen = rig.see(mine, found.z, found.d)
        except NumericalError:
            failed.append(cases.names[i])
            continue
        left[i], posed[i] = (seen.y - mine.target)[0], seen.posed[0]
        slopes = np.concatenate([seen.by_z, seen.by_d], axis=3)[0]
        spread = np.einsum("kin,nm,kjm->kij", slopes, found.covariance, slopes)
        covariance[i] = spread + whole.scatter.variance(seen.moved[0])[:, None, None] * np.eye(3)
    return LeftOut(left, covariance, tuple(failed), tuple(posed))


def criteria(found: CaseFit) -> dict[str, float]:
    """AICc and BIC, with n_eff as the number of parameters (Burnham and Anderson, Model Selection, 2002)."""
    n, k = found.count, found.free + 1 + (found.scatter.share > 0)
    V = found.scatter.variance(found.linear.moved)
    fit = np.log(V).sum() + n * np.log((found.linear.r**2 / V).sum() / n)
    correction = 2 * k * (k + 1) / (n - k - 1) if n > k + 1 else np.inf
    return {"aicc": float(fit + 2 * k + correction), "bic": float(fit + k * np.log(n))}


def told(rig: Rig, found: CaseFit) -> list[str]:
    """What the measurements leave open, a sentence each."""
    n_z, sentences = len(rig.unknowns), []
    deviations = np.sqrt(np.diag(found.covariance))[:n_z]
    if n_z == 0:
        return []
    correlation = found.covariance[:n_z, :n_z] / np.outer(deviations, deviations)
    for i, one in enumerate(rig.unknowns):
        if one.known and deviations[i] > LEARNED:
            sentences.append(
                f"{one.name}: the measurements say little of it, its interval is {100 * deviations[i]:.0f} % as wide "
                "as what was known before"
            )
        for j in range(i):
            if abs(correlation[i, j]) > APART:
                way = "together" if correlation[i, j] > 0 else "against each other"
                sentences.append(
                    f"{rig.unknowns[j].name} and {one.name} cannot be told apart: changed {way} they leave nearly the "
                    f"same shapes (correlation {correlation[i, j]:+.2f})"
                )
        low, high = one.bounds
        if min(found.z[i] - low, high - found.z[i]) < 1e-3 * (high - low):
            sentences.append(f"{one.name} lies at an end of its range: widen it, or ask why")
    return sentences
