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

import numpy as np

TRUSTED = 0.3  # r to which a body that softens is followed


@dataclass(frozen=True)
class Beyond:
    """Of loads (..., n) N. motion (..., n) mm; first, second (...): a and b, what is taken of either order; across
    (..., n) mm and rank (...) 1/(N mm): of the derivative, the part rank across across^T."""

    motion: np.ndarray
    first: np.ndarray
    second: np.ndarray
    across: np.ndarray
    rank: np.ndarray

    def slope(self, C: np.ndarray, change: np.ndarray) -> np.ndarray:
        """(..., n, n) mm/N: derivative of the motion by the load; change: D[w]."""
        a, b, rank = (one[..., None, None] for one in (self.first, self.second, self.rank))
        return a * C + b * change + rank * self.across[..., :, None] * self.across[..., None, :]


def beyond(load: np.ndarray, first: np.ndarray, second: np.ndarray) -> Beyond:
    """load w (..., n) N, first C w and second D[w, w] (..., n) mm."""
    twice = (load * first).sum(axis=-1)
    yields = twice > 0
    size = np.where(yields, twice, 1.0)
    r = np.where(yields, (load * second).sum(axis=-1) / (2 * size), 0.0)
    a, b, bend = _taken(r)
    across = 1.5 * second - 2 * r[..., None] * first
    return Beyond(a[..., None] * first + b[..., None] / 2 * second, a, b, across, np.where(yields, bend / size, 0.0))


def _taken(r: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """a, b, and the second derivative of phi."""
    within, far = np.minimum(r, TRUSTED), np.maximum(r, TRUSTED)
    g = 1 / (1 - 0.75 * within)
    slope = g * g / 3
    B = slope * TRUSTED**2
    A = 0.5 + within * g / 3 + slope * TRUSTED
    soft = r > TRUSTED
    a = np.where(soft, 2 * A - 4 * B / far, 1 - (within * g) ** 2 / 2)
    return a, np.where(soft, 3 * B / far**2, 3 * slope), np.where(soft, -2 * B / far**3, g**3 / 2)
