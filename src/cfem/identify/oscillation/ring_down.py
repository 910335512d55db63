"""Frequency and damping of a free oscillation in a window of time, so that windows tell how both go with amplitude."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from cfem.core.errors import InputError

_LEAST = 12  # samples of a window


@dataclass(frozen=True)
class RingDown:
    """A free oscillation in a window.

    amplitude: mm at the window's start
    frequency: Hz, undamped
    damping:   share of the critical
    sd_frequency, sd_damping: standard deviations by the fit's residual
    residual:  mm, root of the mean square"""

    amplitude: float
    frequency: float
    damping: float
    sd_frequency: float
    sd_damping: float
    residual: float


def ring_down(
    t: np.ndarray,
    x: np.ndarray,
    start: float,
    stop: float,
    guess: float,
    others: Sequence[tuple[float, float]] = (),
) -> RingDown:
    """Fits c0 + c1 t + c2 t^2 + A exp(-2 pi f zeta t) cos(...) to the part of a recording from `start` to `stop`, s.

    t, x:   (n,) s, mm
    guess:  Hz, near the frequency
    others: frequency (Hz) and damping of vibrations that are in the recording too, such as of the stand; their
            amplitudes are fitted"""
    inside = (t >= start - 1e-9) & (t < stop - 1e-9)
    if inside.sum() < _LEAST:
        do = f"take {_LEAST} at least"
        raise InputError(f"the window from {start:g} to {stop:g} s holds {inside.sum()} samples", do=do)
    time, height = t[inside] - start, x[inside]
    fixed = [time**0, time, time**2, *(wave for vibration in others for wave in decaying(time, *vibration))]

    def fitted(p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        basis = np.stack([*decaying(time, *p), *fixed], axis=1)
        c, *_ = np.linalg.lstsq(basis, height, rcond=None)
        return height - basis @ c, c

    answer = least_squares(lambda p: fitted(p)[0], [guess, 0.03], x_scale=[guess / 100, 0.01], xtol=1e-12)
    residuals, c = fitted(answer.x)
    left = len(time) - len(c) - 2
    covariance = np.linalg.pinv(answer.jac.T @ answer.jac) * (residuals @ residuals) / left
    sd = np.sqrt(np.diag(covariance))
    rms = np.sqrt(np.mean(residuals**2))
    return RingDown(float(np.hypot(c[0], c[1])), *map(float, (*answer.x, *sd, rms)))


def decaying(t: np.ndarray, frequency: float, damping: float) -> tuple[np.ndarray, np.ndarray]:
    """exp(-omega zeta t) times cosine and sine of the damped frequency; frequency: Hz, undamped."""
    omega = 2 * np.pi * frequency
    envelope, phase = np.exp(-omega * damping * t), omega * np.sqrt(max(1 - damping**2, 0.0)) * t
    return envelope * np.cos(phase), envelope * np.sin(phase)
