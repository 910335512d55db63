"""A model that has learned one energy: its parts at an input, and (W, delta_free) from them."""

from abc import abstractmethod

import numpy as np

from cfem.condensed import Condensed
from cfem.predict.energy import Parts, condense
from cfem.predict.protocol import ArrayPredictor


class PotentialPredictor(ArrayPredictor):
    @abstractmethod
    def parts(self, s: np.ndarray, q: np.ndarray) -> Parts:
        """(..., n_a), (..., n_q) -> the potential, its gradient, ...: every part of `cfem.predict.energy.layout`,
        matrices in full."""

    def learned(self, s: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return condense(self.form, self.rows, s, self.parts(s, q))

    def at(self, s: np.ndarray, p: np.ndarray | None = None) -> Condensed:
        if self.parameters:
            return super().at(s, p)
        s = np.asarray(s, float)
        part = self.parts(s, s[:0])  # whose gradient is what the condensed model would be solved for
        W, delta_free = condense(self.form, self.rows, s, part)
        return Condensed(self.rows, W, delta_free, s if self.form == "force" else part["gradient"])
