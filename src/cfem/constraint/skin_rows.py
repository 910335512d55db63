"""The rows of a skin, watched as effectors are."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cfem.condensed.skin import Skin


@dataclass(frozen=True)
class SkinRows:
    """Rows of the skin on a robot. X: (n, 3) mm all nodes of the robot at rest, which may be of another design than the
    skin's own."""

    skin: Skin
    X: np.ndarray

    @property
    def nodes(self) -> np.ndarray:
        return self.skin.nodes

    @cached_property
    def rest(self) -> np.ndarray:
        return self.value(self.X)

    def value(self, x: np.ndarray) -> np.ndarray:
        return self.skin.rows(x[self.nodes])

    def gradient(self, x: np.ndarray) -> np.ndarray:
        return self.skin.functionals
