"""Viscosity of a material as a value, which bodies, datasets and learned models share."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Viscosity:
    """Viscosity of a material, beside its elastic modulus after a long time."""

    relaxation: float = 0.0  # s, tau of Kelvin-Voigt
    prony: tuple[tuple[float, float], ...] = ()  # (g, tau) of each term, g a share of the modulus, tau in s

    @property
    def none(self) -> bool:
        return self.relaxation == 0.0 and not self.prony

    def modulus(self, omega: float | np.ndarray) -> np.ndarray:
        """Factors (2, ...) on S under vibration at omega, rad/s: in phase, and a quarter ahead."""
        w = np.asarray(omega, float)
        stored, lost = np.zeros_like(w), self.relaxation * w
        for g, tau in self.prony:
            stored = stored + g * (w * tau) ** 2 / (1 + (w * tau) ** 2)
            lost = lost + g * w * tau / (1 + (w * tau) ** 2)
        return np.stack([stored, lost])
