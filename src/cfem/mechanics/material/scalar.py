"""Functions of one number that vanish to second order, without cancellation near zero."""

import math

from numba import njit


@njit(cache=True)
def expm1_less(x: float) -> float:
    """Value of exp(x) - 1 - x; by its Taylor series, to 1e-16 of itself, for |x| < 0.1. Also y - log1p(y), at x =
    log1p(y)."""
    if abs(x) > 0.1:
        return math.expm1(x) - x
    series = 1.0
    for n in range(10, 2, -1):
        series = 1.0 + x / n * series
    return 0.5 * x * x * series
