"""What a hyperelastic law is: an energy density split into a volumetric part and the rest.

    psi(F) = psi_rest(F) + bulk / 2 theta(F)^2

theta is the law's own measure of volume change (J - 1, or the trace of the small strain). The split lets an element
replace theta by its mean, and treat bulk theta as an independent pressure, for every law alike."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Law:
    """name:    as in specs
    moduli:    (young MPa, poisson) -> (shear MPa, bulk MPa), the two numbers that the kernels take
    response:  (D (k, 3, 3), shear, out psi_rest (k,), out theta (k,), out P_rest (k, 3, 3), out g (k, 3, 3)) with
               D = F - 1 the displacement gradient, P_rest = d psi_rest / dF and g = d theta / dF
    curvature: (D, shear, pressure (k,), out C (k, 9, 9)) with C = d2 psi_rest / dF2 + pressure d2 theta / dF2,
               row-major over the entries of F; the term bulk g g^T is the element's

    response and curvature are compiled, fill their outputs and work point by point."""

    name: str
    moduli: Callable[[float, float], tuple[float, float]]
    response: Callable[..., None]
    curvature: Callable[..., None]


def lame(young: float, poisson: float) -> tuple[float, float]:
    """Lame's (lambda, mu) in MPa from Young's modulus and Poisson's ratio."""
    return young * poisson / ((1 + poisson) * (1 - 2 * poisson)), young / (2 * (1 + poisson))


def energy_density(law: Law, F: np.ndarray, young: float, poisson: float) -> np.ndarray:
    """(k,) MPa: psi at deformation gradients F (k, 3, 3)."""
    shear, bulk = law.moduli(young, poisson)
    psi, theta, _P, _g = response(law, F - np.eye(3), shear)
    return psi + bulk / 2 * theta**2


def response(law: Law, D: np.ndarray, shear: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """psi_rest (k,), theta (k,), P_rest (k, 3, 3), g (k, 3, 3) at displacement gradients D (k, 3, 3)."""
    k = len(D)
    out = np.empty(k), np.empty(k), np.empty((k, 3, 3)), np.empty((k, 3, 3))
    law.response(D, shear, *out)
    return out


def stress(law: Law, F: np.ndarray, young: float, poisson: float) -> np.ndarray:
    """(k, 3, 3) MPa: first Piola-Kirchhoff stress d psi / dF."""
    shear, bulk = law.moduli(young, poisson)
    _, theta, P, g = response(law, F - np.eye(3), shear)
    return P + bulk * theta[:, None, None] * g


def tangent(law: Law, F: np.ndarray, young: float, poisson: float) -> np.ndarray:
    """(k, 9, 9) MPa: d2 psi / dF2."""
    shear, bulk = law.moduli(young, poisson)
    D = F - np.eye(3)
    _, theta, _, g = response(law, D, shear)
    C = np.empty((len(F), 9, 9))
    law.curvature(D, shear, bulk * theta, C)
    g = g.reshape(-1, 9)
    return C + bulk * g[:, :, None] * g[:, None, :]
