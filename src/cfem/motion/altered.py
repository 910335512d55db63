"""A model that moves whose material is not the one that it was learned from."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cfem.motion.model import MotionModel, MotionTerms


@dataclass(frozen=True)
class Altered:
    """The model with `stiffness` times its modulus of elasticity, whose viscosity goes with it, and `viscosity` times
    its viscosity on top of that. Of one material without loads: forces are in proportion to the modulus. It stands
    for a `MotionModel` where a motion is stepped."""

    model: MotionModel
    stiffness: float = 1.0
    viscosity: float = 1.0

    def at(self, delta_a: np.ndarray) -> MotionTerms:
        """Terms of the altered model at delta_a (n_a,) mm."""
        place, s = self.model.at(delta_a), self.stiffness
        return replace(
            place, pull=s * place.pull, stiff=s * place.stiff, inner=s * place.inner, F=s * self.viscosity * place.F
        )

    def forces(self, delta_a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Forces of the altered model at delta_a (n_a,) mm."""
        pull, stiff = self.model.forces(delta_a)
        return self.stiffness * pull, self.stiffness * stiff

    def inertia(self, delta_a: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Inertia of the altered model at delta_a (n_a,) mm."""
        M, dM, F = self.model.inertia(delta_a)
        return M, dM, self.stiffness * self.viscosity * F

    @property
    def inner(self) -> np.ndarray:
        return self.stiffness * self.model.inner

    def __getattr__(self, name: str) -> Any:
        """All that does not change with the material is the model's."""
        return getattr(object.__getattribute__(self, "model"), name)
