"""A hyperelastic law: an energy density split into a volumetric part and the rest.

    psi(F) = psi_rest(F) + bulk / 2 theta(F)^2

theta is the law's own measure of volume change (J - 1, ln J, or the trace of a strain). The split lets an element
replace theta by its mean, and treat bulk theta as an independent pressure, for every law alike. Every law has
bulk = lambda and a rest that linearises to mu |strain|^2: a rest without resistance to dilatation (kappa in the place
of lambda) would leave a quadratic tetrahedron with a mean theta three modes of no energy, the conformal ones."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Law:
    """A hyperelastic law.

    name:       as in specs
    parameters: (young MPa, poisson, shape) -> (parameters (n_p,), bulk MPa), what the kernels take; ValueError where
                the law has no such shape numbers
    response:   (D (k, 3, 3), parameters, out psi_rest (k,), out theta (k,), out P_rest (k, 3, 3), out g (k, 3, 3)) with
                D = F - 1 the displacement gradient, P_rest = d psi_rest / dF and g = d theta / dF
    curvature:  (D, parameters, pressure (k,), out C (k, 9, 9)) with C = d2 psi_rest / dF2 + pressure d2 theta / dF2,
                row-major over the entries of F; the term bulk g g^T is the element's
    shape:      default of the dimensionless numbers beside young and poisson

    response and curvature are compiled, fill their outputs and work point by point. Where det F <= 0, a law that is
    defined for det F > 0 only fills with NaN."""

    name: str
    parameters: Callable[[float, float, tuple[float, ...]], tuple[np.ndarray, float]]
    response: Callable[..., None]
    curvature: Callable[..., None]
    shape: tuple[float, ...] = ()


@dataclass(frozen=True)
class Material:
    """A law with its constants: young MPa, Poisson's ratio, and shape, the law's default where None."""

    law: Law
    young: float
    poisson: float
    shape: tuple[float, ...] | None = None

    @property
    def moduli(self) -> tuple[np.ndarray, float]:
        """Parameters (n_p,) and bulk modulus MPa as the law's kernels and the elements take them."""
        return self.law.parameters(self.young, self.poisson, self.law.shape if self.shape is None else self.shape)


def lame(young: float, poisson: float) -> tuple[float, float]:
    """Lame's (lambda, mu) in MPa from Young's modulus and Poisson's ratio."""
    return young * poisson / ((1 + poisson) * (1 - 2 * poisson)), young / (2 * (1 + poisson))


def shear_and_bulk(young: float, poisson: float, shape: tuple[float, ...] = ()) -> tuple[np.ndarray, float]:
    """Law.parameters of the laws without shape numbers: ([mu], lambda) in MPa."""
    if len(shape):
        raise ValueError(f"this law has no shape numbers; got {len(shape)}")
    lam, mu = lame(young, poisson)
    return np.array([mu]), lam


def evaluate(law: Law, D: np.ndarray, parameters: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Values psi_rest (k,), theta (k,), P_rest (k, 3, 3), g (k, 3, 3) at displacement gradients D (k, 3, 3)."""
    k = len(D)
    out = np.empty(k), np.empty(k), np.empty((k, 3, 3)), np.empty((k, 3, 3))
    law.response(D, parameters, *out)
    return out


def curvature(law: Law, D: np.ndarray, parameters: np.ndarray, pressure: np.ndarray) -> np.ndarray:
    """Second derivatives (k, 9, 9) d2 psi_rest / dF2 + pressure d2 theta / dF2 at displacement gradients D (k, 3, 3),
    pressures (k,)."""
    C = np.empty((len(D), 9, 9))
    law.curvature(D, parameters, pressure, C)
    return C


def stress(law: Law, F: np.ndarray, young: float, poisson: float, shape: tuple[float, ...] | None = None) -> np.ndarray:
    """First Piola-Kirchhoff stress (k, 3, 3) MPa, d psi / dF."""
    parameters, bulk = Material(law, young, poisson, shape).moduli
    _, theta, P, g = evaluate(law, F - np.eye(3), parameters)
    return P + bulk * theta[:, None, None] * g
