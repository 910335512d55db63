"""Many condensed states at once, each of a robot of its own."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from cfem.condensed import Condensed


@dataclass(frozen=True)
class States(Condensed):
    """States of m robots, a batch of `Condensed`.

    p: (m, n_p) parameters of their robots
    rest_e: (m, n_e) mm rest positions of the effectors, of each robot its own
    numbers: (m,) by name, of the whole bodies, where finite elements give them: volume mm^3, mass t, strain, stress
    MPa"""

    p: np.ndarray
    rest_e: np.ndarray
    numbers: Mapping[str, np.ndarray] | None = None

    def __len__(self) -> int:
        return len(self.p)

    @property
    def x_e(self) -> np.ndarray:
        """Positions (m, n_e) mm of the effectors."""
        return self.rest_e + self.delta_e

    def first(self, count: int) -> "States":
        """The first states, without numbers of the bodies."""
        arrays = (self.W, self.delta_free, self.lam, self.p, self.rest_e)
        return States(self.rows, *(array[:count] for array in arrays))
