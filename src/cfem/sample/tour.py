"""The order of work: a skeleton spread over the plan, then compact shards through which one walks from row to row.

All depends on the plan alone, so that what a state is started from never depends on who solves it."""

import numpy as np

from cfem.condensed.spread import spread


def skeleton(u: np.ndarray, count: int) -> np.ndarray:
    """`count` (or all) indices into u (m, n_a), in the order of a walk: the row nearest to rest (u = 0), and again and
    again the row farthest from those chosen."""
    return walk(u, spread(u, count, int(np.argmin((u**2).sum(axis=1)))))


def shards(u: np.ndarray, indices: np.ndarray, size: int) -> list[np.ndarray]:
    """The rows `indices` of u in boxes of at most `size` rows, the rows of each in the order of a walk. Boxes come from
    halving at the median of the widest side."""
    if len(indices) == 0:
        return []
    if len(indices) <= size:
        return [walk(u, indices)]
    side = int(np.argmax(np.ptp(u[indices], axis=0)))
    ordered = indices[np.argsort(u[indices, side], kind="stable")]
    middle = len(ordered) // 2
    return shards(u, ordered[:middle], size) + shards(u, ordered[middle:], size)


def walk(u: np.ndarray, indices: np.ndarray) -> np.ndarray:
    """Path through `indices` from the row nearest to rest on, always to the nearest row not yet visited."""
    unvisited = list(indices)
    step = int(np.argmin((u[unvisited] ** 2).sum(axis=1)))
    path = [unvisited.pop(step)]
    while unvisited:
        step = int(np.argmin(((u[unvisited] - u[path[-1]]) ** 2).sum(axis=1)))
        path.append(unvisited.pop(step))
    return np.array(path)
