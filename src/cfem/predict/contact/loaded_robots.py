"""Learned robots at held actuators, under forces on patches of their surfaces: one compliant system in the scene."""

from collections.abc import Iterator, Sequence

import numpy as np
from numba import njit

from cfem.predict.contact.bodies import Bodies, PlacedModel
from cfem.predict.contact.loaded_robot import LoadedRobot


class LoadedRobots:
    """Loaded robots of a scene.

    placed: the robots where they stand now
    known (c,): patches, among all N of the scene, whose local motion is known, and that may bear forces
    forces (N, 3) N: on all patches, in the scene's axes"""

    def __init__(self, scene: Bodies, deltas: Sequence[np.ndarray], known: np.ndarray, forces: np.ndarray):
        self.scene, self.placed = scene, list(scene.robots)
        each = zip(scene.robots, deltas, strict=True)
        self.loaded = [LoadedRobot(robot.patched, delta, robot.wrench) for robot, delta in each]
        self.know(known, forces)

    def know(self, known: np.ndarray, forces: np.ndarray) -> None:
        """Other patches known, under forces (N, 3) N."""
        self.known, self.forces = known, forces
        for robot, loaded, patches, first in self._each():
            local = forces[patches]
            loaded.load(patches - first, local if robot.in_scene else local @ robot.R)

    def load(self, forces: np.ndarray) -> None:
        """Forces (c, 3) N on the known patches."""
        everywhere = np.zeros_like(self.forces)
        everywhere[self.known] = forces
        self.know(self.known, everywhere)

    @property
    def on_known(self) -> np.ndarray:
        """(c, 3) N."""
        return self.forces[self.known]

    def places(self) -> np.ndarray:
        """(N, 3) mm of all patches."""
        each = zip(self.placed, self.loaded, strict=True)
        places = [
            loaded.places() if robot.in_scene else loaded.places() @ robot.R.T + robot.t for robot, loaded in each
        ]
        return places[0] if len(places) == 1 else np.concatenate(places)

    def normals(self) -> np.ndarray:
        """(N, 3) outward of all patches."""
        return self.scene.normals([loaded.rows for loaded in self.loaded], self.placed)

    def compliance(self, under_forces: bool) -> np.ndarray:
        """(3 c, 3 c) mm/N of the known patches; under_forces: as the forces have changed it."""
        if self.scene.robots[0].in_scene and len(self.loaded) == 1:
            return self._own_compliance(self.loaded[0], self.known, under_forces)
        total, begin = np.zeros((3 * len(self.known),) * 2), 0
        for robot, loaded, patches, first in self._each():
            _add_turned(total, begin, self._own_compliance(loaded, patches - first, under_forces), robot.R)
            begin += len(patches)
        return total

    @staticmethod
    def _own_compliance(loaded: LoadedRobot, patches: np.ndarray, under_forces: bool) -> np.ndarray:
        return loaded.compliance() if under_forces else loaded.free_compliance(patches)

    def outputs(self) -> tuple[list[np.ndarray], list[np.ndarray], list[np.ndarray], list[np.ndarray]]:
        """Displacements delta_e (n_e,) mm and forces lambda_a (n_a,) N of each robot; by how much (n_a,) N the forces
        on patches relieve the actuators, and how far (n_e,) mm they move the effectors."""
        delta_e, lambda_a, relief, moved = [], [], [], []
        for loaded in self.loaded:
            (e, lam), pressed = loaded.held.alone, loaded.forces.any()
            moved.append(loaded.effector_motion() if pressed else np.zeros(len(e)))
            relief.append(loaded.relief() if pressed else np.zeros(len(lam)))
            delta_e.append(e + moved[-1])
            lambda_a.append(lam - relief[-1])
        return delta_e, lambda_a, relief, moved

    def _each(self) -> Iterator[tuple[PlacedModel, LoadedRobot, np.ndarray, int]]:
        """Robots, the known patches of each, and the number of its first patch."""
        for robot, loaded, patches in zip(self.placed, self.loaded, self.scene.slices, strict=True):
            known = self.known
            if len(self.loaded) > 1:
                known = known[(known >= patches.start) & (known < patches.stop)]
            yield robot, loaded, known, patches.start


@njit(cache=True, error_model="numpy")
def _add_turned(total, begin, C, R):
    """Puts C (3 c, 3 c), turned by R, into `total` from point `begin` on."""
    half = np.empty((3, 3))
    for i in range(0, len(C), 3):
        for j in range(0, len(C), 3):
            for a in range(3):
                for b in range(3):
                    half[a, b] = R[a, 0] * C[i, j + b] + R[a, 1] * C[i + 1, j + b] + R[a, 2] * C[i + 2, j + b]
            for a in range(3):
                for b in range(3):
                    value = half[a, 0] * R[b, 0] + half[a, 1] * R[b, 1] + half[a, 2] * R[b, 2]
                    total[3 * begin + i + a, 3 * begin + j + b] = value
