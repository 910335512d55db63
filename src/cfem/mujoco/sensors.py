"""What MuJoCo's sensors of soft robots say: the force on each, and the places of its effectors."""

from collections.abc import Mapping

import mujoco
import numpy as np
from numba import njit

from cfem.mujoco.geoms import MM
from cfem.mujoco.soft_robot import SoftRobot
from cfem.predict.contact.step.state import ContactState


class Sensors:
    """Sensors of robots (r) with effectors (p) together, that `description.add_robot` has added."""

    def __init__(self, model: mujoco.MjModel, robots: Mapping[str, SoftRobot]):
        """robots: by name."""
        names = [f"{name}.{point}" for name, robot in robots.items() for point in robot.points]
        self._numbers = np.arange(len(robots))
        self._forces, self._points = (
            np.array([model.sensor(each).adr + np.arange(3) for each in some], dtype=np.int64).reshape(-1, 3)
            for some in ([f"{name}.force" for name in robots], names)
        )
        surfaces = [robot.surface.model for robot in robots.values()]
        first = np.cumsum([0, *(each.rows.n_e for each in surfaces)])
        rows = [robot.point_rows + begin for robot, begin in zip(robots.values(), first, strict=False)]
        self._rows, self._of = np.concatenate(rows), np.repeat(self._numbers, [len(each) for each in rows])
        self._rest = np.concatenate([each.rest_e for each in surfaces])[self._rows]

    def write(self, values: np.ndarray, state: ContactState, R: np.ndarray, t: np.ndarray) -> None:
        """Puts what they say of a state into the values of all sensors; R (r, 3, 3), t (r, 3) mm: of the robots."""
        places = self._points, self._rest, self._rows, self._of, state.answers.displaced
        _write(values, self._forces, state.bodies, state.forces, *places, R, t)


@njit(cache=True, error_model="numpy")
def _write(values, forces_at, bodies, forces, points_at, rest, rows, of, delta_e, R, t):
    """Puts forces (N, 3) N on points of robots `bodies` (N,) together into values at forces_at (r, 3), and places of
    effectors into those at points_at (p, 3), m: rest (p, 3) mm, and rows (p, 3) of delta_e, mm, of robots `of` (p,) at
    R (r, 3, 3) and t (r, 3) mm."""
    for i in range(len(forces_at)):
        for a in range(3):
            values[forces_at[i, a]] = 0.0
    for p in range(len(bodies)):
        for a in range(3):
            values[forces_at[bodies[p], a]] += forces[p, a]
    for p in range(len(points_at)):
        for a in range(3):
            place = t[of[p], a]
            for b in range(3):
                place += R[of[p], a, b] * (rest[p, b] + delta_e[rows[p, b]])
            values[points_at[p, a]] = place / MM
