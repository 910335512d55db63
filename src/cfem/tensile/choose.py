"""Which law the curves support: error on blocks of neighbouring points that a fit has not seen, and the information
criterion AICc beside it (Burnham and Anderson, Model Selection and Multimodel Inference, 2002, section 2.4)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cfem.tensile.curve import Curve
from cfem.tensile.fit import Fit, fit
from cfem.tensile.forms import Form

_BLOCKS = 5


@dataclass(frozen=True)
class Candidate:
    """held_out: MPa, rms over blocks that the fit had not seen, with its standard error; aicc: lower is better."""

    fit: Fit
    held_out: float
    held_out_error: float
    aicc: float

    @property
    def stable(self) -> bool:
        """In every mode over the range of the curves."""
        limits = self.fit.stable
        most = max(limits.values())
        return all(np.isclose(limits[mode], most) for mode in limits if mode != "compression") and bool(
            np.isclose(limits["compression"] * most, 1.0)
        )


def candidates(forms: Sequence[Form], curves: Sequence[Curve], with_slack: bool = False) -> list[Candidate]:
    """Those that have fewer constants than the curves have points to leave out."""
    m = sum(len(one.stretch) for one in curves)
    most = max(max(one.stretch.max(), 1 / one.stretch.min()) for one in curves)
    return [
        _candidate(form, curves, with_slack, most)
        for form in forms
        if form.constants + with_slack < m - m // _BLOCKS - 1
    ]


def choose(found: Sequence[Candidate]) -> Candidate:
    """Fewest constants among those whose held-out error is within one standard error of the best (Breiman's rule);
    unstable laws only where all are."""
    among = [one for one in found if one.stable] or list(found)
    best = min(among, key=lambda one: one.held_out)
    near = [one for one in among if one.held_out <= best.held_out + best.held_out_error]
    return min(near, key=lambda one: (one.fit.form.constants, one.held_out))


def _candidate(form: Form, curves: Sequence[Curve], with_slack: bool, most: float) -> Candidate:
    whole = fit(form, curves, with_slack, most)
    squares = np.array([np.mean(_unseen(form, curves, block, with_slack, most) ** 2) for block in range(_BLOCKS)])
    held_out = float(np.sqrt(squares.mean()))
    error = float(squares.std(ddof=1) / np.sqrt(_BLOCKS) / (2 * held_out)) if held_out > 0 else 0.0
    m, k = len(whole.residuals), whole.n_fitted + 1  # the noise is fitted as well
    rss = max(float(whole.residuals @ whole.residuals), 1e-300)
    aicc = m * np.log(rss / m) + 2 * k + (2 * k * (k + 1) / (m - k - 1) if m > k + 1 else np.inf)
    return Candidate(whole, held_out, error, float(aicc))


def _unseen(form: Form, curves: Sequence[Curve], block: int, with_slack: bool, most: float) -> np.ndarray:
    """Computed less measured stress of a block of each curve, by a fit to the rest."""
    blocks = [np.array_split(np.arange(len(one.stretch)), _BLOCKS)[block] for one in curves]
    seen = [_part(one, np.setdiff1d(np.arange(len(one.stretch)), out)) for one, out in zip(curves, blocks, strict=True)]
    rest = fit(form, seen, with_slack, most)
    return np.concatenate([rest.predict(one)[out] - one.stress[out] for one, out in zip(curves, blocks, strict=True)])


def _part(curve: Curve, kept: np.ndarray) -> Curve:
    return replace(curve, stretch=curve.stretch[kept], stress=curve.stress[kept])
