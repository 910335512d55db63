"""A robot whose material becomes softer or stiffer while it works."""

from dataclasses import dataclass, field, replace

import numpy as np

from cfem.plant.protocol import Command, Measurement, Plant


@dataclass
class DriftingPlant:
    """A robot of one material without loads whose stiffness goes from 1 to `factor` times its first within `ticks`, in
    equal steps: the same displacements under forces of so many times the size (identity 6 of the condensed model)."""

    plant: Plant
    factor: float
    ticks: int
    _done: int = field(default=0, init=False)
    moves = True  # from step to step, whatever it is told

    def step(self, u: np.ndarray, kind: Command = "displacement") -> Measurement:
        self._done += 1
        stiffness = 1.0 + (self.factor - 1.0) * min(self._done / self.ticks, 1.0)
        measurement = self.plant.step(np.asarray(u, float) / (stiffness if kind == "force" else 1.0), kind)
        lam = None if measurement.lambda_a is None else stiffness * measurement.lambda_a
        return replace(measurement, lambda_a=lam)
