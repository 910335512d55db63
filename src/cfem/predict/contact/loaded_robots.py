"""Learned robots at held actuators, under forces on patches of their surfaces: one compliant system in the scene."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numba import njit

from cfem.predict.contact.bodies import Bodies
from cfem.predict.contact.loaded_robot import LoadedRobot


class LoadedRobots:
    """Loaded robots of a scene.

    R (r, 3, 3), t (r, 3) mm: where the robots stand now
    known (c,): patches, among all N of the scene, whose local motion is known, and that may bear forces
    forces (N, 3) N: on all patches, on_known (c, 3) N: on the known ones, in the scene's axes"""

    def __init__(self, scene: Bodies, deltas: Sequence[np.ndarray], known: np.ndarray, forces: np.ndarray):
        self.scene, self.R, self.t = scene, scene.R, scene.t
        each = zip(scene.robots, deltas, strict=True)
        self.loaded = [LoadedRobot(robot.patched, delta, robot.wrench) for robot, delta in each]
        self.know(known, forces)

    def know(self, known: np.ndarray, forces: np.ndarray) -> None:
        """Other patches known, under forces (N, 3) N."""
        self.known, self.forces = known, forces
        ends = np.searchsorted(known, self.scene.ends).tolist()
        self._parts = [
            (known[a:b] - first, a, b) for (a, b), first in zip(pairwise(ends), self.scene.ends, strict=False)
        ]
        self._put(forces[known])

    def load(self, forces: np.ndarray) -> None:
        """Forces (c, 3) N on the known patches."""
        self.forces = np.zeros(self.forces.shape)
        self.forces[self.known] = forces
        self._put(forces)

    def _put(self, forces: np.ndarray) -> None:
        self.on_known = forces
        for loaded, (patches, a, b), R in zip(self.loaded, self._parts, self.R, strict=True):
            loaded.load(patches, forces[a:b] @ R)

    def own_places(self) -> np.ndarray:
        """(N, 3) mm of all patches, in the frames of their robots."""
        places = [loaded.places() for loaded in self.loaded]
        return places[0] if len(places) == 1 else np.concatenate(places)

    def normals(self) -> np.ndarray:
        """(N, 3) outward of all patches."""
        return self.scene.normals([loaded.rows for loaded in self.loaded], self.R)

    def compliance(self, under_forces: bool) -> np.ndarray:
        """(3 c, 3 c) mm/N of the known patches; under_forces: as the forces have changed it."""
        total = np.zeros((3 * len(self.known),) * 2)
        for loaded, (patches, a, _), R in zip(self.loaded, self._parts, self.R, strict=True):
            if len(patches):
                _add_turned(total, a, loaded.compliance() if under_forces else loaded.free_compliance(patches), R)
        return total

    def outputs(self) -> tuple[list[np.ndarray], list[np.ndarray], list[np.ndarray], list[np.ndarray]]:
        """Displacements delta_e (n_e,) mm and forces lambda_a (n_a,) N of each robot; by how much (n_a,) N the forces
        on patches relieve the actuators, and how far (n_e,) mm they move the effectors."""
        delta_e, lambda_a, relief, moved = [], [], [], []
        for loaded in self.loaded:
            (e, lam), pressed = loaded.held.alone, loaded.bears
            moved.append(loaded.effector_motion() if pressed else np.zeros(len(e)))
            relief.append(loaded.relief() if pressed else np.zeros(len(lam)))
            delta_e.append(e + moved[-1])
            lambda_a.append(lam - relief[-1])
        return delta_e, lambda_a, relief, moved


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
