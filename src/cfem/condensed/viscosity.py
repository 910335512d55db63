"""Viscosity of a material as a value, which bodies, datasets and learned models share."""

from collections.abc import Sequence
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


def stiffened(
    squares: np.ndarray, materials: Sequence[Viscosity], by_material: Sequence[np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Squares omega^2 (k,) 1/s^2 of modes with the stiffness that viscosity stores at their frequencies, and phi . loss
    . phi (k,) 1/s^2, from the squares without it; by_material: phi . S phi (k,) 1/s^2 of each material."""
    with_stored, lost = squares, np.zeros_like(squares)
    for _ in range(20 if materials else 0):
        moduli = [material.modulus(np.sqrt(with_stored)) for material in materials]
        stored, lost = sum(m * q for m, q in zip(moduli, by_material, strict=True))
        with_stored = squares + stored
    return with_stored, lost
