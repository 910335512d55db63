"""A finite-element robot with markers on its surface, and the truth about that surface."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cfem.constraint.surface import outer_surface
from cfem.equilibrium.system.robot import Robot
from cfem.plant.protocol import Command, Measurement, Plant
from cfem.predict.estimation.markers import on_triangles


class MarkedPlant:
    """`Plant`. plant: of FE, its nodes at `x`; markers (m, 3) and points (k, 3) mm: places at rest, of which the
    nearest points of the surface are meant. Answers carry where those are."""

    def __init__(self, plant: Plant, robot: Robot, markers: np.ndarray, points: np.ndarray):
        surface = outer_surface(robot.X, robot.facets)
        self._plant, self._nodes = plant, surface.nodes
        self._weights = [on_triangles(positions, surface.rest, surface.triangles)[0] for positions in (markers, points)]

    @property
    def moves(self) -> bool:
        return getattr(self._plant, "moves", False)

    def settle(self, u: np.ndarray, kind: Command = "displacement") -> Measurement:
        """Measurement of a plant that moves, at rest under u."""
        return self._seen(self._plant.settle(u, kind))

    def step(self, u: np.ndarray, kind: Command = "displacement") -> Measurement:
        return self._seen(self._plant.step(u, kind))

    def _seen(self, measurement: Measurement) -> Measurement:
        if measurement.status != "converged":
            return measurement
        x = self._plant.x[self._nodes]
        markers, surface = (weights @ x for weights in self._weights)
        return replace(measurement, markers=markers, surface=surface)


class MarkerNoise:
    """Errors of a camera that sees markers: noise (mm) on each coordinate; a share `lost` that nobody sees; a share
    `wrong` that is another point, `astray` mm away, standard deviation of each coordinate. displacement (mm), force
    (N): noise of the actuators' sensors, None where there are none."""

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

        noise, astray: mm, standard deviations of markers, and of those that are mistaken
        lost, wrong: shares of markers that are not seen, or mistaken
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
