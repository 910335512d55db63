"""A robot ready for mechanics: one meshed body, what holds it, what drives it, what is watched."""

from dataclasses import dataclass

import numpy as np

from cfem.condensed import Rows
from cfem.constraint.protocol import Constraint
from cfem.mechanics.solid import Solid


@dataclass(frozen=True)
class Robot:
    """name:      of the scene
    body:       the elastic solid at rest
    fixed:      indices of held nodes
    actuators:  one constraint a row, in the order of rows.actuators
    effectors:  one constraint three rows (x, y, z), in the order of rows.effectors
    reach:      (n_a, 2) mm smallest and largest actuator displacement
    unilateral: (n_a,) True where the actuator can pull and cannot push
    length:     mm, what '% of length' refers to"""

    name: str
    body: Solid
    fixed: np.ndarray
    actuators: tuple[Constraint, ...]
    effectors: tuple[Constraint, ...]
    rows: Rows
    reach: np.ndarray
    unilateral: np.ndarray
    length: float

    @property
    def rest_e(self) -> np.ndarray:
        """(n_e,) mm rest positions of the effectors."""
        return np.concatenate([effector.rest for effector in self.effectors])
