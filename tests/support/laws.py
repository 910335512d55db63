"""Energy density and second derivative of a law, whole: what the elements take apart."""

import numpy as np

from cfem.mechanics.material.law import Law, Material, curvature, evaluate


def energy_density(
    law: Law, F: np.ndarray, young: float, poisson: float, shape: tuple[float, ...] | None = None
) -> np.ndarray:
    """(k,) MPa: psi at deformation gradients F (k, 3, 3)."""
    parameters, bulk = Material(law, young, poisson, shape).moduli
    psi, theta, _, _ = evaluate(law, F - np.eye(3), parameters)
    return psi + bulk / 2 * theta**2


def tangent(
    law: Law, F: np.ndarray, young: float, poisson: float, shape: tuple[float, ...] | None = None
) -> np.ndarray:
    """(k, 9, 9) MPa: d2 psi / dF2."""
    parameters, bulk = Material(law, young, poisson, shape).moduli
    D = F - np.eye(3)
    _, theta, _, g = evaluate(law, D, parameters)
    g = g.reshape(-1, 9)
    return curvature(law, D, parameters, bulk * theta) + bulk * g[:, :, None] * g[:, None, :]
