"""What a body does beyond the second order of a load, as far as its energy along the load tells it.

Under a load w the compliance C and its change D give the energy w . C w / 2 + D[w, w, w] / 6. Along a load that grows
its terms are those of a series in r = D[w, w, w] / (2 w . C w), which for a body that stiffens (r < 0) alternates and
soon diverges. Its Pade approximant of the first order in either (Baker and Graves-Morris, *Pade Approximants*, 1996)

    Phi = w . C w phi(r)        phi = 1/2 + (r / 3) / (1 - 3 r / 4)

agrees with the series and goes on: r^2 / 4, as for a spring whose stiffness changes in proportion to the load. Beyond
r = TRUSTED, where the body softens, phi goes on as A - B / r, which is bounded. The motion is the derivative of Phi,

    a C w + b D[w, w] / 2        a = 2 (phi - r phi')    b = 3 phi'

and its own derivative is symmetric."""

from dataclasses import dataclass
from typing import Any

import numpy as np

TRUSTED = 0.3  # r to which a body that softens is followed


@dataclass(frozen=True)
class Beyond:
    """Of loads (..., n) N. motion (..., n) mm; first, second (...): a and b, what is taken of either order; across
    (..., n) mm and rank (...) 1/(N mm): of the derivative, the part rank across across^T."""

    motion: np.ndarray
    first: np.ndarray | float
    second: np.ndarray | float
    across: np.ndarray
    rank: np.ndarray | float

    def slope(self, C: np.ndarray, change: np.ndarray) -> np.ndarray:
        """(..., n, n) mm/N: derivative of the motion by the load; change: D[w]."""
        a, b, rank = (np.asarray(one)[..., None, None] for one in (self.first, self.second, self.rank))
        return a * C + b * change + rank * self.across[..., :, None] * self.across[..., None, :]


def beyond(load: np.ndarray, first: np.ndarray, second: np.ndarray) -> Beyond:
    """load w (..., n) N, first C w and second D[w, w] (..., n) mm."""
    if load.ndim == 1:
        size = float(load @ first)
        r = float(load @ second) / (2 * size) if size > 0 else 0.0
        a, b, bend = _series(r) if r <= TRUSTED else _bounded(r)
        return Beyond(a * first + b / 2 * second, a, b, 1.5 * second - 2 * r * first, bend / size if size > 0 else 0.0)
    size = (load * first).sum(axis=-1)
    size[~(size > 0)] = np.inf
    r = (load * second).sum(axis=-1) / (2 * size)
    a, b, bend = _series(np.minimum(r, TRUSTED))
    soft = r > TRUSTED
    if soft.any():
        a[soft], b[soft], bend[soft] = _bounded(r[soft])
    r = r[..., None]
    return Beyond(a[..., None] * first + b[..., None] / 2 * second, a, b, 1.5 * second - 2 * r * first, bend / size)


def _series(r: Any) -> tuple[Any, Any, Any]:
    """a, b, and the second derivative of phi."""
    g = 1 / (1 - 0.75 * r)
    return 1 - (r * g) ** 2 / 2, g * g, g * g * g / 2


def _bounded(r: Any) -> tuple[Any, Any, Any]:
    """The same beyond TRUSTED: phi is A - B / r."""
    g = 1 / (1 - 0.75 * TRUSTED)
    B = (g * TRUSTED) ** 2 / 3
    A = 0.5 + TRUSTED * g / 3 + TRUSTED * g * g / 3
    return 2 * A - 4 * B / r, 3 * B / r**2, -2 * B / r**3
