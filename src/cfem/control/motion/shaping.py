"""Input shaping: a command is spread over impulses that leave no vibration behind.

Zero vibration (ZV) and zero vibration and derivative (ZVD) shapers of one mode (Singer and Seering, J. Dyn. Syst. Meas.
Control 112, 1990): with K = exp(-zeta pi / sqrt(1 - zeta^2)) and half a damped period between impulses,

    ZV:  1, K over 1 + K        ZVD:  1, 2 K, K^2 over (1 + K)^2

Several modes are shaped one after the other. A shaper delays by the mean time of its impulses; where what lies ahead is
known, commands are taken from that much later."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

Kind = Literal["zv", "zvd"]


@dataclass(frozen=True)
class Shaper:
    """Impulses of a shaper: amplitude (k,), of sum 1, and time (k,) s."""

    amplitude: np.ndarray
    time: np.ndarray

    @property
    def delay(self) -> float:
        """Delay (s) by which a slow command comes late."""
        return float(self.amplitude @ self.time)

    def residual(self, frequency: float, damping: float) -> float:
        """Share of its vibration that a mode (Hz, share of the critical) keeps."""
        omega = 2 * np.pi * frequency
        decay, turn = damping * omega, omega * np.sqrt(1 - damping**2)
        last = self.time.max()
        phases = self.amplitude * np.exp(-decay * (last - self.time)) * np.exp(1j * turn * self.time)
        return float(abs(phases.sum()))

    def ticks(self, dt: float) -> tuple[np.ndarray, int]:
        """Weights of commands at ticks of dt s around the present one, and how many of them lie ahead: the shaper
        advanced by its delay. An impulse between two ticks is shared by them."""
        ticks = (self.time - self.delay) / dt
        first = int(np.floor(ticks.min()))
        weights = np.zeros(int(np.floor(ticks.max())) - first + 2)
        below = np.floor(ticks).astype(int)
        np.add.at(weights, below - first, self.amplitude * (1 - (ticks - below)))
        np.add.at(weights, below - first + 1, self.amplitude * (ticks - below))
        return weights, -first


def shaper(kind: Kind, frequency: np.ndarray, damping: np.ndarray) -> Shaper:
    """Shaper of modes (k,), frequencies in Hz and damping as shares of the critical one, below 1."""
    train = Shaper(np.ones(1), np.zeros(1))
    for f, zeta in zip(frequency, damping, strict=True):
        root = np.sqrt(1 - zeta**2)
        K, half = np.exp(-zeta * np.pi / root), 0.5 / (f * root)
        amplitude = np.array([1.0, K] if kind == "zv" else [1.0, 2 * K, K**2])
        amplitude /= amplitude.sum()
        time = half * np.arange(len(amplitude))
        train = Shaper(np.outer(train.amplitude, amplitude).ravel(), np.add.outer(train.time, time).ravel())
    return train
