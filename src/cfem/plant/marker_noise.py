"""Errors of a camera that sees markers, and of the actuators' sensors."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cfem.plant.protocol import Measurement


class MarkerNoise:
    """Errors of a camera that sees markers, and of the actuators' sensors."""

    def __init__(
        self,
        noise: float,
        lost: float = 0.0,
        wrong: float = 0.0,
        astray: float = 0.0,
        sensors: Sequence[float | None] = (None, None),
        seed: int = 0,
    ):
        """Noise and loss of markers.

        noise: mm, standard deviation of each coordinate of a marker
        lost: share of markers that nobody sees
        wrong: share that is another point, `astray` mm (standard deviation of each coordinate) away
        sensors: mm and N, standard deviations of the actuators' sensors, None where there are none"""
        self._noise, self._lost, self._wrong, self._astray = noise, lost, wrong, astray
        self._sensors, self._random = sensors, np.random.default_rng([seed, 1])  # x_e has a stream of its own

    def seen(self, true: Measurement) -> Measurement:
        """Sample of a measurement: markers nan where nobody sees them, sensors None where there are none."""
        random, markers = self._random, true.markers
        delta_a, lambda_a = (
            None if sd is None or values is None else values + sd * random.standard_normal(len(values))
            for sd, values in zip(self._sensors, (true.delta_a, true.lambda_a), strict=True)
        )
        if markers is not None:
            chance = random.random((2, len(markers)))
            apart = np.where(chance[0] < self._wrong, self._astray, self._noise)[:, None]
            markers = markers + apart * random.standard_normal(markers.shape)
            markers[chance[1] < self._lost] = np.nan
        return replace(true, markers=markers, surface=None, delta_a=delta_a, lambda_a=lambda_a)
