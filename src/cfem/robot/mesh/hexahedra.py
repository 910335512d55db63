"""A bar of hexahedra in rows and columns, without a mesh generator."""

from collections.abc import Sequence

import numpy as np

from cfem.robot.cad import Box
from cfem.robot.catalogue.sections import steps

# Corners of a cell, in steps along the axes, in VTK's order.
_CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])


def block(box: Box, size: float, regions: Sequence[Box] = ()) -> tuple[np.ndarray, np.ndarray]:
    """X (n, 3) and cells (m, 8) that fill `box` with edges of at most `size` mm, equal between the faces of the
    `regions`, which lie between cells."""
    axes = []
    for axis in range(3):
        low, high = box.low[axis], box.high[axis]
        faces = {side[axis] for region in regions for side in (region.low, region.high)}
        near = 1e-9 * (high - low)
        stops = [low]
        for face in sorted(faces):
            if stops[-1] + near < face < high - near:
                stops.append(face)
        axes.append(steps([*stops, high], size))
    X = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    counts = [len(axis) for axis in axes]
    strides = np.array([counts[1] * counts[2], counts[2], 1])
    first = np.stack(np.meshgrid(*(np.arange(count - 1) for count in counts), indexing="ij"), axis=-1).reshape(-1, 3)
    return X, (first @ strides)[:, None] + _CORNERS @ strides
