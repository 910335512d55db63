"""Yeoh's law of nearly incompressible rubber: `polynomial` without the second invariant. The shape numbers are c2/c1
and c3/c1. Yeoh, Some forms of the strain energy function for rubber, Rubber Chem. Technol. 66, 1993."""

import numpy as np

from cfem.mechanics.material.law import Law, lame
from cfem.mechanics.material.polynomial import curvature, response


def parameters(young: float, poisson: float, shape: tuple[float, ...]) -> tuple[np.ndarray, float]:
    """Parameters of `polynomial` ([c1, c2, c3, 0], lambda) in MPa."""
    if len(shape) != 2:
        raise ValueError(f"yeoh has two shape numbers, c2/c1 and c3/c1; got {len(shape)}")
    lam, mu = lame(young, poisson)
    return 0.5 * mu * np.array([1.0, shape[0], shape[1], 0.0]), lam


LAW = Law("yeoh", parameters, response, curvature, shape=(0.1, 0.01))
