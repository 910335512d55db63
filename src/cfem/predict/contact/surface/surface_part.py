"""Some points of a surface that may be touched, such as those near an obstacle: contact with them costs as much as
they are many. What it does to them is what it would do with all points."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from cfem.predict.contact.surface.surface_model import SurfaceModel


@dataclass(frozen=True)
class PartPoints:
    """rest: (n, 3) mm, places of the points"""

    rest: np.ndarray

    def __len__(self) -> int:
        return len(self.rest)


class SurfacePart:
    """A `SurfaceModel` of the points `numbers` (n,) of another. What is not of points is that one's."""

    def __init__(self, whole: SurfaceModel, numbers: np.ndarray):
        self.whole, self.numbers = whole, numbers
        self.patches = PartPoints(whole.patches.rest[numbers])
        self.U, self.held_still = whole.U[numbers], whole.held_still[numbers]
        self.flat = self.U.reshape(-1, self.U.shape[-1])
        self.model, self.kept, self.most = whole.model, whole.kept, whole.most  # asked for in each step

    def __getattr__(self, name: str) -> Any:
        return getattr(self.whole, name)

    @cached_property
    def flexibility(self) -> np.ndarray:
        return self.whole.flexibility[self.numbers]

    @cached_property
    def local_tip(self) -> np.ndarray:
        return self.whole.local_tip[:, :, self.numbers]

    def turns(self, rows: np.ndarray, patches: np.ndarray) -> np.ndarray:
        return self.whole.turns(rows, self.numbers[patches])
