"""Learned models that run on arrays here, and their kinds by name."""

from abc import abstractmethod

import numpy as np

from cfem.predict.protocol import Predictor


class ArrayPredictor(Predictor):
    """A model that runs on arrays here. A kind says what it has learned; exact parameters are dealt with for all.

    class Mine(ArrayPredictor, kind="mine") joins the kinds that `build` knows."""

    def __init_subclass__(cls, kind: str = "", **others):
        super().__init_subclass__(**others)
        if kind:
            KINDS[kind] = cls

    @abstractmethod
    def learned(self, s: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(..., n_a) inputs of the form, (..., n_q) coordinates of the parameters that are learned -> W (..., n, n),
        delta_free (..., n), at the reference of those that are exact."""

    def evaluate(self, s: np.ndarray, p: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        if not self.parameters:
            return self.learned(s, s[..., :0])
        p = np.broadcast_to(self._p(p), (*s.shape[:-1], len(self.parameters)))
        softer = self.softer(p)[..., None]
        W, delta_free = self.learned(s * softer if self.form == "force" else s, self.q(p))
        return W * softer[..., None], delta_free


KINDS: dict[str, type[ArrayPredictor]] = {}


def build(meta: dict, arrays: dict[str, np.ndarray]) -> ArrayPredictor:
    """The NumPy predictor of a model in memory. Its kind's module must have been imported: `cfem.predict.load` imports
    all of them."""
    return KINDS[meta["kind"]](meta, arrays)
