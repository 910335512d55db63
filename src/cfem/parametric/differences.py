"""Derivatives of functions that are evaluated in batches, by central differences of high order.

Where a response is analytic, as those of the learned energy models are, order 6 with 1 % of a parameter's range as step
has an error of about 1e-10 of the response: truncation h^6 f^(7) / 140, rounding 1e-16 / h (Fornberg, Math. Comp. 51,
1988, table 1, has the weights)."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

_WEIGHTS = {2: [1 / 2], 4: [2 / 3, -1 / 12], 6: [3 / 4, -3 / 20, 1 / 60]}


@dataclass(frozen=True)
class Stencil:
    """Central differences. order: 2, 4 or 6; step: as a share of each coordinate's scale."""

    order: int
    step: float

    @property
    def roughness(self) -> float:
        """Largest slope by a coordinate that errors of size one, random from point to point, may give."""
        return 2 * float(np.abs(_WEIGHTS[self.order]).sum()) / self.step

    def points(self, z: np.ndarray) -> np.ndarray:
        """Points (1 + order n, n) of the differences at z (n,): z, then for each coordinate the points ahead, in order,
        and behind it."""
        shifts = self.step * np.arange(1, self.order // 2 + 1)
        along = np.concatenate([shifts, -shifts])
        return np.concatenate([z[None], *(z + along[:, None] * unit for unit in np.eye(len(z)))])

    def slopes(self, values: np.ndarray) -> np.ndarray:
        """Derivatives (..., n) at z from values (1 + order n, ...) at `points`."""
        ahead, behind = np.split(values[1:].reshape(-1, self.order, *values.shape[1:]), 2, axis=1)
        weights = np.array(_WEIGHTS[self.order]) / self.step
        return np.moveaxis(np.tensordot(weights, ahead - behind, (0, 1)), 0, -1)


def with_slopes(
    function: Callable[[np.ndarray], np.ndarray], z: np.ndarray, stencil: Stencil
) -> tuple[np.ndarray, ...]:
    """Value (...) and derivatives (..., n) at z (n,) of a function (k, n) -> (k, ...), which is called once."""
    values = function(stencil.points(z))
    return values[0], stencil.slopes(values)
