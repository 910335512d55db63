"""A model that has learned one energy: its parts at an input, and (W, delta_free) from them."""

from abc import abstractmethod

import numpy as np

from cfem.condensed import Condensed
from cfem.predict.array_predictor import ArrayPredictor
from cfem.predict.series.energy import Parts, condense


class PotentialPredictor(ArrayPredictor):
    @abstractmethod
    def parts(self, s: np.ndarray, q: np.ndarray) -> Parts:
        """Every part of `cfem.predict.series.energy.layout` at inputs s (..., n_a) and parameters q (..., n_q): the
        potential, its gradient and so on, matrices in full."""

    def learned(self, s: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return condense(self.form, self.rows, s, self.parts(s, q), self.sizes)

    def at(self, s: np.ndarray, p: np.ndarray | None = None) -> Condensed:
        if self.parameters:
            return super().at(s, p)
        s = np.asarray(s, float)
        part = self.parts(s, s[..., :0])  # whose gradient is what the condensed model would be solved for
        W, delta_free = condense(self.form, self.rows, s, part, self.sizes)
        return Condensed(self.rows, W, delta_free, s if self.form == "force" else part["gradient"])

    def ends_at_displacement(self, delta_a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if self.parameters or self.form == "force":
            return super().ends_at_displacement(delta_a)
        self._demand_near(delta_a, *self.domain.delta_a, "displacements", 0)
        part = self.parts(delta_a, delta_a[:0])
        return part["effector"], part["gradient"]

    def slopes(self, delta_a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Forces lambda_a (B, n_a) and d lambda_a / d delta_a (B, n_a, n_a) at delta_a (B, n_a) mm and the scene's own
        parameters, for users who need nothing of the effectors."""
        if self.parameters or self.form == "force":
            states = [self.at_displacement(delta) for delta in delta_a]
            return np.array([state.lam for state in states]), np.array([np.linalg.inv(state.W_aa) for state in states])
        return self.gradient_and_hessian(delta_a)

    def gradient_and_hessian(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Gradient (..., n_a) and Hessian (..., n_a, n_a) of the potential at s (..., n_a) and the
        scene's own parameters."""
        part = self.parts(s, s[..., :0])
        return part["gradient"], part["hessian"]
