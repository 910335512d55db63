"""A finite-element robot with markers on its surface, and the truth about that surface."""

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
