"""Points spread over many: each the farthest from those before (Gonzalez, Theoretical Computer Science 38, 1985)."""

import numpy as np


def spread(points: np.ndarray, count: int, first: int) -> np.ndarray:
    """`count` (or all) different indices into points (m, n), from `first` on."""
    chosen, distance, latest = [], np.full(len(points), np.inf), first
    for _ in range(min(count, len(points))):
        chosen.append(latest)
        distance = np.minimum(distance, ((points - points[latest]) ** 2).sum(axis=1))
        distance[latest] = -1.0  # chosen once, even where points are equal
        latest = int(np.argmax(distance))
    return np.array(chosen, dtype=int)


def outermost(points: np.ndarray, middle: np.ndarray) -> int:
    """Index of the point (m, n) that is farthest from `middle` (n,)."""
    return int(np.argmax(((points - middle) ** 2).sum(axis=1)))
