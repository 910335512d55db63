"""Mooney-Rivlin law of nearly incompressible rubber: `polynomial` with c10 = c1 and c01 alone. Its one shape number is
the share of c01 in c10 + c01."""

import numpy as np

from cfem.mechanics.material.law import Law, lame
from cfem.mechanics.material.polynomial import curvature, response


def parameters(young: float, poisson: float, shape: tuple[float, ...]) -> tuple[np.ndarray, float]:
    """Parameters of `polynomial` ([c10, 0, 0, c01], lambda) in MPa."""
    if len(shape) != 1:
        raise ValueError(f"mooney-rivlin has one shape number, the share of c01 in c10 + c01; got {len(shape)}")
    lam, mu = lame(young, poisson)
    return 0.5 * mu * np.array([1.0 - shape[0], 0.0, 0.0, shape[0]]), lam


LAW = Law("mooney-rivlin", parameters, response, curvature, shape=(0.2,))
