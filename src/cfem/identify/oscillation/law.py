"""Viscosity of a body from a free oscillation: a Prony series whose terms relax within given times.

One vibration of a body all of whose parts are viscous alike, in the units of its elastic modulus after a long time:

    u'' / omega^2 + u + tau u' + sum_i Q_i = 0,    Q_i' + Q_i / tau_i = g_i u'

(mechanics/viscosity.py at small strains; u is mm from where it comes to rest). From a time on it runs freely. What the
terms remember then follows from the recording itself, held at rest before its release, so that it does not matter how
the release went."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from cfem.condensed.viscosity import Viscosity
from cfem.core.errors import InputError
from cfem.identify.oscillation.ring_down import decaying, ring_down

_LEAST = 1e-4  # share of a term that is left out of the answer
_PERIODS = 4.0  # of the window that gives a first guess


@dataclass(frozen=True)
class FittedViscosity:
    """A Prony series that a free oscillation has told.

    viscosity: of every part of the body
    elastic:   Hz, natural frequency without viscosity, at the modulus after a long time
    frequency: Hz with viscosity, undamped
    damping:   share of the critical
    residual:  mm, root of the mean square"""

    viscosity: Viscosity
    elastic: float
    frequency: float
    damping: float
    residual: float

    @property
    def scene(self) -> str:
        """The lines of a material in a scene."""
        terms = ", ".join(f"{{share: {g:.4g}, time: {1e3 * tau:.4g} ms}}" for g, tau in self.viscosity.prony)
        return f"viscosity: {{prony: [{terms}]}}"


def free_vibration(elastic: float, viscosity: Viscosity) -> tuple[float, float]:
    """Undamped frequency (Hz) and damping of a vibration of this frequency (Hz) without viscosity, by its complex
    pole."""
    poles = np.linalg.eigvals(_matrix(2 * np.pi * elastic, viscosity))
    pole = poles[np.argmax(poles.imag)]
    return float(abs(pole) / (2 * np.pi)), float(-pole.real / abs(pole))


def fit_viscosity(
    t: np.ndarray,
    x: np.ndarray,
    start: float,
    times: Sequence[float],
    guess: float,
    still: float | None = None,
    others: Sequence[tuple[float, float]] = (),
) -> FittedViscosity:
    """Shares g >= 0 of terms that relax within `times` (s), and the elastic frequency, by least squares.

    t, x:   (n,) s, mm of a recording that begins at rest; x of a marker, along the vibration
    start:  s, from which on the body vibrates freely and in small strains
    guess:  Hz, near the frequency
    still:  Hz, natural frequency at the modulus that the shape at the recording's end has told, without viscosity. The
            oscillation alone hardly tells it: a term that relaxes within a period or ten is taken for elasticity
    others: frequency (Hz) and damping of vibrations that are in the recording too; their amplitudes are fitted"""
    later = t >= start - 1e-9
    if later.all() or not later.any():
        raise InputError(f"start {start:g} s is not within the recording, which must begin before the release")
    first = ring_down(t, x, start, start + _PERIODS / guess, guess, others)
    tau, time, u = np.asarray(times, float), t[later] - start, x[later] - x[0]
    remembered = _remembered(t[: len(t) - len(time) + 1], x[: len(t) - len(time) + 1], tau)
    held = _remembered(t, x, tau) / (x[-1] - x[0])  # what each term still bears at the end, of its share
    waves = np.stack([wave for vibration in others for wave in decaying(time, *vibration)], axis=1) if others else None

    def elastic_of(p: np.ndarray) -> float:
        return float(p[0] if still is None else still / np.sqrt(1 + p[4:] @ held))

    def residuals(p: np.ndarray) -> np.ndarray:
        """Residuals mm at p: Hz, place and speed over omega at the start, place at last (mm), g."""
        place, speed, last, g = p[1], p[2], p[3], p[4:]
        omega = 2 * np.pi * elastic_of(p)
        begin = np.concatenate([[place - last, omega * speed], g * remembered])
        left = u - last - _free(time, _matrix(omega, _law(g, tau)), begin)
        return left if waves is None else left - waves @ np.linalg.lstsq(waves, left, rcond=None)[0]

    n = len(tau)
    p = np.concatenate([[0.97 * first.frequency, u[0], 0.0, u[-1]], np.full(n, 0.03)])
    span = np.ptp(u)
    low = np.concatenate([[0.5 * guess], np.full(3, -np.inf), np.zeros(n)])
    high = np.concatenate([[1.5 * guess], np.full(3, np.inf), np.full(n, 5.0)])
    scale = np.concatenate([[0.01 * guess], np.full(3, span / 50), np.full(n, 0.02)])
    answer = least_squares(residuals, p, bounds=(low, high), x_scale=scale, xtol=1e-12)
    kept = answer.x[4:] > _LEAST
    law = _law(answer.x[4:][kept], tau[kept])
    elastic = elastic_of(answer.x)
    rms = float(np.sqrt(np.mean(answer.fun**2)))
    return FittedViscosity(law, elastic, *free_vibration(elastic, law), rms)


def _law(g: np.ndarray, tau: np.ndarray) -> Viscosity:
    return Viscosity(0.0, tuple((float(a), float(b)) for a, b in zip(g, tau, strict=True)))


def _matrix(omega: float, viscosity: Viscosity) -> np.ndarray:
    """A of d(u, u', Q_i)/dt = A (u, u', Q_i)."""
    n = len(viscosity.prony)
    A = np.zeros((n + 2, n + 2))
    A[0, 1] = 1.0
    A[1] = -(omega**2)
    A[1, 1] = -(omega**2) * viscosity.relaxation
    for i, (g, tau) in enumerate(viscosity.prony, start=2):
        A[i, 1], A[i, i] = g, -1 / tau
    return A


def _free(t: np.ndarray, A: np.ndarray, begin: np.ndarray) -> np.ndarray:
    """u (n,) at times t after the state `begin`."""
    rates, shapes = np.linalg.eig(A)
    share = np.linalg.solve(shapes, begin.astype(complex))
    return (np.exp(np.outer(t, rates)) @ (shapes[0] * share)).real


def _remembered(t: np.ndarray, x: np.ndarray, tau: np.ndarray) -> np.ndarray:
    """Q_i / g_i (n,) mm at the end of a recording from rest, x linear between its samples."""
    q = np.zeros(len(tau))
    for dt, dx in zip(np.diff(t), np.diff(x), strict=True):
        q = np.exp(-dt / tau) * q - np.expm1(-dt / tau) * tau / dt * dx
    return q
