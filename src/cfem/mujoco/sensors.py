"""What MuJoCo's sensors of soft robots say: the force on each, and the places of its effectors."""

from collections.abc import Mapping

import mujoco
import numpy as np

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
        values[self._forces] = (state.bodies == self._numbers[:, None]).astype(float) @ state.forces
        places = self._rest + np.concatenate(state.delta_e)[self._rows]
        values[self._points] = ((R[self._of] @ places[:, :, None])[:, :, 0] + t[self._of]) / MM
