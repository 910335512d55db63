"""Choice of the law that the curves support: error on blocks of neighbouring points that a fit has not seen, and the
information criterion AICc beside it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cfem.identify.fit.criteria import aicc
from cfem.identify.material.curve import Curve
from cfem.identify.material.fit import LawFit, fit_law, largest_stretch
from cfem.identify.material.forms import Form

_BLOCKS = 5


@dataclass(frozen=True)
class Candidate:
    """A law that was tried.

    fit:            to all points
    held_out:       MPa, rms over blocks that the fit had not seen
    held_out_error: MPa, its standard error
    aicc:           lower is better"""

    fit: LawFit
    held_out: float
    held_out_error: float
    aicc: float


def candidates(forms: Sequence[Form], curves: Sequence[Curve], with_slack: bool = False) -> list[Candidate]:
    """The forms fitted, of those that have fewer constants than the curves have points to leave out."""
    m = sum(len(curve.stretch) for curve in curves)
    points = m - m // _BLOCKS - 1
    return [_candidate(form, curves, with_slack) for form in forms if form.constants + with_slack < points]


def choose(tried: Sequence[Candidate]) -> Candidate:
    """The candidate of fewest constants among those whose held-out error is within one standard error of the best
    (Breiman's rule); unstable laws only where all are."""
    eligible = [candidate for candidate in tried if candidate.fit.is_stable] or list(tried)
    best = min(eligible, key=lambda candidate: candidate.held_out)
    near = [candidate for candidate in eligible if candidate.held_out <= best.held_out + best.held_out_error]
    return min(near, key=lambda candidate: (candidate.fit.form.constants, candidate.held_out))


def _candidate(form: Form, curves: Sequence[Curve], with_slack: bool) -> Candidate:
    """A form fitted to all points, and to all but one block of each curve in turn."""
    fitted = fit_law(form, curves, with_slack)
    squares = np.array([np.mean(_held_out(form, curves, block, with_slack) ** 2) for block in range(_BLOCKS)])
    held_out = float(np.sqrt(squares.mean()))
    error = float(squares.std(ddof=1) / np.sqrt(_BLOCKS) / (2 * held_out)) if held_out > 0 else 0.0
    m, square = len(fitted.residuals), max(float(fitted.residuals @ fitted.residuals), 1e-300)
    criterion = aicc(m * float(np.log(square / m)), m, fitted.n_fitted + 1)  # the noise is fitted as well
    return Candidate(fitted, held_out, error, criterion)


def _held_out(form: Form, curves: Sequence[Curve], block: int, with_slack: bool) -> np.ndarray:
    """Computed less measured stress (MPa) of a block of each curve, by a fit to the rest."""
    left_out, seen = [], []
    for curve in curves:
        numbers = np.arange(len(curve.stretch))
        left_out.append(np.array_split(numbers, _BLOCKS)[block])
        kept = np.setdiff1d(numbers, left_out[-1])
        seen.append(replace(curve, stretch=curve.stretch[kept], stress=curve.stress[kept]))
    fitted = fit_law(form, seen, with_slack, largest_stretch(curves))
    errors = [fitted.predict(curve)[out] - curve.stress[out] for curve, out in zip(curves, left_out, strict=True)]
    return np.concatenate(errors)
