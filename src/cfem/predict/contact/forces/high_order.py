"""What a body does beyond the second order of a load, as far as its energy along the load tells it.

Under a load w the compliance C and its change D give the energy w . C w / 2 + D[w, w, w] / 6. Along a load that grows
its terms are those of a series in r = D[w, w, w] / (2 w . C w), which for a body that stiffens (r < 0) alternates and
soon diverges. Its Pade approximant of the first order in either (Baker and Graves-Morris, *Pade Approximants*, 1996)

    Phi = w . C w phi(r)        phi = 1/2 + (r / 3) / (1 - 3 r / 4)

agrees with the series and goes on: r^2 / 4, as for a spring whose stiffness changes in proportion to the load. Beyond
r = TRUSTED, where the body softens, phi goes on as A - B / r, which is bounded. The motion is the derivative of Phi,

    a C w + b D[w, w] / 2        a = 2 (phi - r phi')    b = 3 phi'

and its own derivative is symmetric."""

from typing import NamedTuple

import numpy as np
from numba import njit

TRUSTED = 0.8  # r to which a body that softens is followed


class HighOrderMotion(NamedTuple):
    """Motion under a load (n,) N.

    motion: (n,) mm
    first, second: a and b, what is taken of either order
    across, rank: (n,) mm and 1/(N mm), of the derivative the part rank across across^T"""

    motion: np.ndarray
    first: float
    second: float
    across: np.ndarray
    rank: float


@njit(cache=True, error_model="numpy")
def beyond(load, first, second):
    """Motion under a load with its higher orders: load w (n,) N, first C w and second D[w, w] (n,) mm."""
    size, third = 0.0, 0.0
    for i in range(len(load)):
        size += load[i] * first[i]
        third += load[i] * second[i]
    r = third / (2 * size) if size > 0 else 0.0
    g = 1 / (1 - 0.75 * min(r, TRUSTED))
    if r <= TRUSTED:
        a, b, bend = 1 - (r * g) ** 2 / 2, g * g, g * g * g / 2
    else:
        B = (g * TRUSTED) ** 2 / 3
        A = 0.5 + TRUSTED * g / 3 + TRUSTED * g * g / 3
        a, b, bend = 2 * A - 4 * B / r, 3 * B / r**2, -2 * B / r**3
    motion, across = np.empty(len(load)), np.empty(len(load))  # by loops: whole arrays take seconds to compile
    for i in range(len(load)):
        motion[i] = a * first[i] + b / 2 * second[i]
        across[i] = 1.5 * second[i] - 2 * r * first[i]
    return HighOrderMotion(motion, a, b, across, bend / size if size > 0 else 0.0)


@njit(cache=True, error_model="numpy")
def slope(motion, C, change):
    """Derivative (n, n) mm/N of a motion by its load; change: D[w]."""
    n = len(C)
    derivative = np.empty((n, n))
    for i in range(n):
        for j in range(n):
            derivative[i, j] = (
                motion.first * C[i, j]
                + motion.second * change[i, j]
                + motion.rank * (motion.across[i] * motion.across[j])
            )
    return derivative
