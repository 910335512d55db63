"""Where a model was trained: the box that its states fill, in displacements and in multipliers."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Domain:
    """Smallest and largest of the training states, with a margin.

    delta_a: (2, n_a) mm; lambda_a: (2, n_a) N. Pulling states fill a wedge of the displacements, whose box would be
    mostly empty: the box of the multipliers cuts the wedge out of it."""

    delta_a: np.ndarray
    lambda_a: np.ndarray

    @classmethod
    def of(cls, delta_a: np.ndarray, lambda_a: np.ndarray, margin: float = 0.05) -> "Domain":
        """From states (m, n_a) each; `margin` is a share of each range."""
        return cls(_box(delta_a, margin), _box(lambda_a, margin))

    @classmethod
    def from_json(cls, data: dict) -> "Domain":
        return cls(np.asarray(data["delta_a"], float), np.asarray(data["lambda_a"], float))

    def to_json(self) -> dict:
        return {"delta_a": self.delta_a.tolist(), "lambda_a": self.lambda_a.tolist()}

    def holds(self, delta_a: np.ndarray, lambda_a: np.ndarray) -> bool:
        """Whether one state (n_a,), (n_a,) lies inside."""
        return bool(
            (delta_a >= self.delta_a[0]).all()
            and (delta_a <= self.delta_a[1]).all()
            and (lambda_a >= self.lambda_a[0]).all()
            and (lambda_a <= self.lambda_a[1]).all()
        )


def _box(states: np.ndarray, margin: float) -> np.ndarray:
    low, high = states.min(axis=0), states.max(axis=0)
    return np.stack([low - margin * (high - low), high + margin * (high - low)])
