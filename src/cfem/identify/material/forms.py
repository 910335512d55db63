"""Laws of incompressible rubber in principal stretches, linear in their moduli.

    w = sum of moduli times terms;   t_i = d w / d h_i,   K_ij = d2 w / d h_i d h_j,   h_i = ln l_i

A power term of exponent a is (l_1^a + l_2^a + l_3^a - 3) / a, as Ogden writes it. A Yeoh term of degree k is
(l_1^2 + l_2^2 + l_3^2 - 3)^k. Nominal stress along axis 1, where axis 3 is free, is (t_1 - t_3) / l_1."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

Mode = Literal["uniaxial", "biaxial", "planar"]
MODES: tuple[Mode, ...] = ("uniaxial", "biaxial", "planar")


@dataclass(frozen=True)
class Form:
    """The form of a law.

    name:    as users choose it
    law:     as scenes know it
    powers:  exponents of its power terms, None for one that a fit finds
    degrees: of its Yeoh terms"""

    name: str
    law: str
    powers: tuple[float | None, ...] = ()
    degrees: tuple[int, ...] = ()

    @property
    def free(self) -> int:
        """Number of exponents that a fit finds."""
        return sum(power is None for power in self.powers)

    @property
    def moduli(self) -> int:
        """Number of moduli."""
        return len(self.powers) + len(self.degrees)

    @property
    def constants(self) -> int:
        """Number of constants that a fit finds."""
        return self.moduli + self.free

    def exponents(self, alpha: Sequence[float]) -> np.ndarray:
        """Exponents of all power terms; alpha: those that a fit finds."""
        free = iter(alpha)
        return np.array([next(free) if power is None else power for power in self.powers], float)


FORMS = {
    form.name: form
    for form in (
        Form("neo-hookean", "yeoh", degrees=(1,)),
        Form("mooney-rivlin", "mooney-rivlin", powers=(2.0, -2.0)),
        Form("yeoh-2", "yeoh", degrees=(1, 2)),
        Form("yeoh-3", "yeoh", degrees=(1, 2, 3)),
        Form("ogden-1", "ogden", powers=(None,)),
        Form("ogden-2", "ogden", powers=(None, None)),
        Form("ogden-3", "ogden", powers=(None, None, None)),
    )
}


def log_stretches(mode: Mode, stretch: np.ndarray) -> np.ndarray:
    """Logarithmic stretches h (m, 3) of a test at stretches (m,), of volume 1; axis 3 is free."""
    h = np.log(stretch)
    second = {"uniaxial": -h / 2, "biaxial": h, "planar": np.zeros_like(h)}[mode]
    return np.stack([h, second, -h - second], axis=1)


def kirchhoff(form: Form, alpha: Sequence[float], h: np.ndarray) -> np.ndarray:
    """Kirchhoff stresses t (m, 3, n) of each term at modulus 1, at h (m, 3)."""
    powers = [np.exp(a * h) for a in form.exponents(alpha)]
    square = np.exp(2 * h)
    rise = np.expm1(2 * h).sum(axis=1)[:, None]
    return np.stack([*powers, *(2 * k * rise ** (k - 1) * square for k in form.degrees)], axis=2)


def curvature(form: Form, alpha: Sequence[float], h: np.ndarray) -> np.ndarray:
    """Second derivatives K (m, 3, 3, n) of each term at modulus 1, at h (m, 3)."""
    square = np.exp(2 * h)
    rise = np.expm1(2 * h).sum(axis=1)[:, None, None]
    terms = [a * np.exp(a * h)[:, :, None] * np.eye(3) for a in form.exponents(alpha)]
    outer = 4 * square[:, :, None] * square[:, None, :]
    for k in form.degrees:
        twice = k * (k - 1) * rise ** (k - 2) * outer if k > 1 else 0.0
        terms.append(4 * k * rise ** (k - 1) * square[:, :, None] * np.eye(3) + twice)
    return np.stack(terms, axis=3)


def nominal_stress(form: Form, alpha: Sequence[float], mode: Mode, stretch: np.ndarray) -> np.ndarray:
    """Nominal stresses (m, n), force over the area at rest, that each term gives at modulus 1."""
    t = kirchhoff(form, alpha, log_stretches(mode, stretch))
    return (t[:, 0] - t[:, 2]) / stretch[:, None]


def shear_modulus(form: Form, alpha: Sequence[float]) -> np.ndarray:
    """Shares (n,) of each term at modulus 1 in the shear modulus at rest."""
    return np.array([*form.exponents(alpha) / 2, *(2.0 if k == 1 else 0.0 for k in form.degrees)])
