"""A learned robot that touches a body with any point of its surface, and holds it there.

Its samples know neither points nor forces. Forces on points of its surface move it as contact with obstacles has it
(`cfem.predict.contact.forces.loaded_robots`)."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from cfem.contact.law.path import definite
from cfem.equilibrium.contact.surface_robot import SurfaceRobot
from cfem.equilibrium.system.actuation import Actuation
from cfem.predict.contact.forces.loaded_robots import LoadedRobots
from cfem.predict.contact.step.state import TRUSTED
from cfem.predict.contact.surface.surface_model import SurfaceModel
from cfem.predict.contact.surface.surfaces import Surfaces

DEFINITE = 1e-9  # of the largest eigenvalue of a compliance: the smallest is no less
STEP = 1e-4  # of the reach: of differences by the actuators

NOTHING = np.zeros(0, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class SurfaceResponse:
    """One state, as `Equilibrium` has it.

    delta_c (3 k,) mm, lambda_c (3 k,) N: of the contact points
    places (N, 3) mm, forces (N, 3) N: of all points, in the robot's frame
    error: estimate of how far what forces do is off, a share of it
    slopes: of its places and forces by the actuators, under constant forces"""

    delta_a: np.ndarray
    lambda_a: np.ndarray
    delta_c: np.ndarray
    lambda_c: np.ndarray
    places: np.ndarray
    forces: np.ndarray
    error: float
    slopes: Callable[[], tuple[np.ndarray, np.ndarray]]
    converged: bool = True
    factorizations: int = 0

    @cached_property
    def _slopes(self) -> tuple[np.ndarray, np.ndarray]:
        return self.slopes()

    @property
    def by_actuators(self) -> np.ndarray:
        """(3 k, n_a), how the points move with the actuators under constant forces."""
        return self._slopes[0]

    @property
    def stiffness(self) -> np.ndarray:
        """(n_a, n_a) N/mm of the actuators under constant forces."""
        return self._slopes[1]


@dataclass(frozen=True)
class SurfaceFinger(SurfaceRobot):
    """`SurfaceRobot`: a learned robot placed by turn (3, 3) and shift (3,) mm; touched: at what points, and how."""

    touched: SurfaceModel
    turn: np.ndarray
    shift: np.ndarray
    numbers: np.ndarray = field(default_factory=lambda: NOTHING)

    @property
    def points(self) -> np.ndarray:
        return self.touched.patches.rest[self.numbers] @ self.turn.T + self.shift

    @property
    def length(self) -> float:
        return self.touched.model.length

    def touching(self, numbers: np.ndarray) -> "SurfaceFinger":
        return replace(self, numbers=numbers)

    def surface(self, state: SurfaceResponse | None) -> np.ndarray:
        places = self.touched.patches.rest if state is None else state.places
        return places @ self.turn.T + self.shift

    def seen(self, state: SurfaceResponse, of: "SurfaceFinger") -> SurfaceResponse:
        loaded = self._loaded(state.delta_a, state.forces)
        return self._response(loaded, state.delta_a)

    def under(
        self, actuators: Actuation, forces: np.ndarray, before: Any = None, tolerance: float = 0.0
    ) -> tuple[SurfaceResponse, np.ndarray]:
        """State under forces (3 k,) N on the points, and their compliance (3 k, 3 k) mm/N: as these change it,
        unless that leaves it indefinite, or is beyond what is known. Actuators are held, whether they pull or push."""
        every = np.zeros((len(self.touched.patches), 3))
        every[self.numbers] = forces.reshape(-1, 3)
        loaded = self._loaded(actuators.target, every)
        response, compliance = self._response(loaded, actuators.target), loaded.compliance(under_forces=True)
        if not (np.isfinite(compliance).all() and definite(compliance)):
            compliance = loaded.compliance(under_forces=False)
            compliance += DEFINITE * np.abs(compliance).max() * np.eye(len(compliance))
        return replace(response, converged=bool(np.isfinite(response.delta_c).all())), compliance

    def inside(self, state: SurfaceResponse) -> bool:
        """True where the model knows the actuators, and forces bend the robot no further than is known."""
        model = self.touched.model
        return state.error <= TRUSTED and model.inside(model.at_displacement(state.delta_a))

    def distance(self, state: SurfaceResponse) -> float:
        """Distance of the free robot from the training states."""
        return self.touched.model.distance(self.touched.model.at_displacement(state.delta_a))

    def _loaded(self, delta_a: np.ndarray, forces: np.ndarray) -> LoadedRobots:
        return LoadedRobots(
            Surfaces([self.touched]), [delta_a], [None], np.eye(3)[None], np.zeros((1, 3)), self.numbers, forces
        )

    def _moved(self, loaded: LoadedRobots) -> np.ndarray:
        return (loaded.places - self.touched.patches.rest)[self.numbers].ravel()

    def _response(self, loaded: LoadedRobots, delta_a: np.ndarray) -> SurfaceResponse:
        """State of the robot under its forces, actuators at delta_a (n_a,) mm."""
        answers, forces = loaded.answers, loaded.forces
        return SurfaceResponse(
            *(delta_a, answers.pull, self._moved(loaded), loaded.on_known.ravel(), loaded.places.copy(), forces),
            *(answers.error, partial(self._slopes, delta_a, forces)),
        )

    def _slopes(self, delta_a: np.ndarray, forces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives by the actuators under constant forces (N, 3) N: of the points (3 k, n_a), and of the actuators'
        forces (n_a, n_a) N/mm. Central differences."""
        n_a = len(delta_a)
        by_actuators, stiffness = np.empty((3 * len(self.numbers), n_a)), np.empty((n_a, n_a))
        for axis, reach in enumerate(self.touched.model.reach):
            step = STEP * np.abs(reach).max() * np.eye(n_a)[axis]
            ahead, behind = (self._loaded(delta_a + side * step, forces) for side in (1, -1))
            by_actuators[:, axis] = (self._moved(ahead) - self._moved(behind)) / (2 * step[axis])
            stiffness[:, axis] = (ahead.answers.pull - behind.answers.pull) / (2 * step[axis])
        return by_actuators, (stiffness + stiffness.T) / 2
