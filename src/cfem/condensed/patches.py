"""A surface cut into patches, each of which may be touched: its place is the mean of its nodes."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np


@dataclass(frozen=True)
class Patches:
    """of (m,): number of the patch that each surface node belongs to; shares (m,): of the node in its patch, of sum 1
    in each; rest (N, 3) mm: places of the patches."""

    of: np.ndarray
    shares: np.ndarray
    rest: np.ndarray

    def __len__(self) -> int:
        return len(self.rest)

    def mean(self, values: np.ndarray) -> np.ndarray:
        """(m, ...) of surface nodes -> (N, ...) of patches."""
        found = np.zeros((len(self), *values.shape[1:]))
        np.add.at(found, self.of, self.shares.reshape(-1, *[1] * (values.ndim - 1)) * values)
        return found

    @cached_property
    def spacing(self) -> float:
        """mm: the distance of neighbours at rest, the median."""
        apart = np.linalg.norm(self.rest[:, None] - self.rest, axis=2) + 1e9 * np.eye(len(self))
        return float(np.median(apart.min(axis=1)))

    @cached_property
    def members(self) -> tuple[np.ndarray, ...]:
        """Surface nodes of each."""
        order = np.argsort(self.of, kind="stable")
        return tuple(np.split(order, np.searchsorted(self.of[order], np.arange(1, len(self)))))


def cut(rest: np.ndarray, weights: np.ndarray, apart: float) -> Patches:
    """Patches of a surface of nodes rest (m, 3) mm with shares `weights` (m,), whose centres are about `apart` mm from
    each other: each the node farthest from those before (Gonzalez 1985), and every node with its nearest."""
    nearest, of = np.full(len(rest), np.inf), np.zeros(len(rest), dtype=np.int64)
    centre, count = int(np.argmax(np.linalg.norm(rest - rest.mean(axis=0), axis=1))), 0
    while nearest.max() > apart:
        away = np.linalg.norm(rest - rest[centre], axis=1)
        closer = away < nearest
        of[closer], nearest[closer] = count, away[closer]
        centre, count = int(np.argmax(nearest)), count + 1
    area = np.maximum(weights, 1e-12 / len(weights))
    shares = area / np.bincount(of, area)[of]
    patches = Patches(of, shares, np.zeros((count, 3)))
    return Patches(of, shares, patches.mean(rest))
