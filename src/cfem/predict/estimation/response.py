"""What forces on chosen rows do to a robot at one state: to its effectors, and to actuators whose forces are held."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cfem.condensed import Condensed
from cfem.predict.protocol import Predictor


@dataclass(frozen=True)
class RowResponse:
    """Response of a robot at one state to forces on chosen rows.

    model: of form displacement, with a skin
    here: the robot without the forces
    q, softer: (n_q,) and factor, its material as `Predictor` has it
    loaded: (n_w,) numbers of rows, effectors first, then modes of the skin"""

    model: Predictor
    state: Condensed
    q: np.ndarray
    softer: float
    loaded: np.ndarray

    @cached_property
    def locked(self) -> np.ndarray:
        """Compliance (n_e, n_w) mm/N of the effectors, actuators locked."""
        G, rows = self.state.effector_jacobian, self.model.rows
        C_ee = self.state.W[rows.e, rows.e] - G @ self.state.W_aa @ G.T
        C_es, _ = self.model.skin.compliance(self.state.delta_a, self.q)
        return np.hstack([C_ee, self.softer * C_es])[:, self.loaded]

    @cached_property
    def actuators(self) -> np.ndarray:
        """W_aw (n_a, n_w) mm/N: of the actuators, their forces held."""
        slopes = [self.state.effector_jacobian, self.model.skin.gradient(self.state.delta_a, self.q)]
        return self.state.W_aa @ np.vstack(slopes)[self.loaded].T

    @cached_property
    def held(self) -> np.ndarray:
        """Compliance (n_e, n_w) mm/N of the effectors, the actuators' forces held."""
        return self.locked + self.state.effector_jacobian @ self.actuators
