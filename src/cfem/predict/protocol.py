"""What every runnable model offers, whatever its kind and runtime."""

from abc import ABC, abstractmethod

import numpy as np

from cfem.condensed import Condensed, Rows
from cfem.predict.domain import Domain


class Predictor(ABC):
    """A model of (W, delta_free) over delta_a, with what its users must know about it.

    meta:   model.json
    rows:   names and order e, a of the rows of W
    rest_e: (n_e,) mm rest positions of the effectors; reach: (n_a, 2) mm; length: mm, what '% of length' refers to
    domain: where it was trained"""

    def __init__(self, meta: dict):
        self.meta = meta
        self.rows = Rows(tuple(meta["rows"]["effectors"]), tuple(meta["rows"]["actuators"]))
        self.rest_e = np.asarray(meta["rest_e"], float)
        self.reach = np.asarray(meta["reach"], float)
        self.length = float(meta["length"])
        self.domain = Domain.from_json(meta["domain"])

    @abstractmethod
    def evaluate(self, delta_a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(B, n_a) mm -> W (B, n, n), delta_free (B, n)."""

    def at_displacement(self, delta_a: np.ndarray) -> Condensed:
        """The condensed robot where the actuators stand at delta_a (n_a,) mm; effectors from their rest position."""
        W, delta_free = (batch[0] for batch in self.evaluate(np.asarray(delta_a, float)[None]))
        a = self.rows.a
        return Condensed(self.rows, W, delta_free, np.linalg.solve(W[a, a], delta_a - delta_free[a]))

    def inside(self, delta_a: np.ndarray) -> bool:
        """Whether delta_a (n_a,) mm, and the multipliers that the model finds there, are those it was trained on."""
        return self.domain.holds(delta_a, self.at_displacement(delta_a).lambda_a)
