"""Information criteria: which of several models the measurements support (Burnham and Anderson, Model Selection and
Multimodel Inference, 2002, section 2.4)."""

import numpy as np


def aicc(deviance: float, count: int, fitted: int) -> float:
    """Akaike's criterion for small samples, lower is better; inf where the numbers are too few.

    deviance: -2 log likelihood, up to a constant of the data
    count:    measured numbers
    fitted:   parameters, the noise counted"""
    if count <= fitted + 1:
        return float("inf")
    return float(deviance + 2 * fitted + 2 * fitted * (fitted + 1) / (count - fitted - 1))


def bic(deviance: float, count: int, fitted: float) -> float:
    """Schwarz's criterion, lower is better; arguments as of `aicc`."""
    return float(deviance + fitted * np.log(count))
