"""Demands on a robot at its obstacles, beside its goals: forces that press, bounds of forces and distances."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cfem.condensed import Rows
from cfem.control.closed_loop.tick import Pilot
from cfem.control.task.obstacles.read import ReadObstacles
from cfem.control.task.obstacles.spec import ObstaclesSpec
from cfem.predict.contact.model import ContactModel

PRESSED = 0.05  # of the force that is wanted: how far off it may be where a goal is reached


@dataclass(frozen=True)
class ObstacleWorld:
    """Obstacles as plans know them.

    rows: of the models, the robot's and one for each obstacle that is pressed or avoided
    goal: (k,) of the latter rows
    weights: (k,) mm/N or 0
    bounds: (k, 2)"""

    rows: Rows
    goal: np.ndarray
    weights: np.ndarray
    bounds: np.ndarray

    def rest(self, rest_e: np.ndarray) -> np.ndarray:
        """Rest positions (n_e,) with the rows of obstacles, (n_e + k,)."""
        return np.concatenate([rest_e, np.zeros(len(self.goal))])

    def goals(self, points: np.ndarray) -> np.ndarray:
        """Goals (m, n_e) with the rows of obstacles, (m, n_e + k)."""
        return np.hstack([points, np.tile(self.goal, (len(points), 1))])

    def pilot(self, pilot: Pilot) -> Pilot:
        """The pilot of the robot alone, with what it is to do with obstacles."""
        n_e = len(pilot.weights)
        bounds = np.vstack([np.tile([-np.inf, np.inf], (n_e, 1)), self.bounds])
        places = np.ones(n_e, dtype=bool) if pilot.places is None else pilot.places
        places = np.concatenate([places, np.zeros(len(self.goal), dtype=bool)])
        weights = np.concatenate([pilot.weights, self.weights])
        return replace(pilot, limits=replace(pilot.limits, delta_e=bounds), weights=weights, places=places)

    def met(self, e: np.ndarray, near: float) -> bool:
        """True if forces are as wanted or allowed, within PRESSED, and distances within `near` (mm). e: (n_e + k,)."""
        values, forces = e[self.rows.n_e - len(self.goal) :], self.weights > 0
        as_wanted = np.abs(values - self.goal)[forces] <= PRESSED * self.goal[forces]
        low, high = self.bounds.T
        above, below = forces | (values >= low - near), values <= (1 + PRESSED) * high
        return bool(as_wanted.all() and above.all() and below.all())

    def results(self, spec: ObstaclesSpec, records: Sequence[Mapping]) -> tuple[dict[str, dict], list[str]]:
        """Results of each obstacle over the rows of a table: figures, and lines for people."""
        figures, lines, n_e = {}, [], self.rows.n_e - len(self.goal)
        x = np.array([row["x_e"] for row in records])[:, n_e:]
        for row, name in enumerate(self.rows.effectors[n_e:]):
            name, what = name.rsplit(".", 1)
            least, most = float(np.nanmin(x[:, row])), float(np.nanmax(x[:, row]))
            figures[name] = {"least": least, "largest": most, "unit": "N" if what == "force" else "mm"}
            obstacle = spec.obstacles[name]
            if what == "distance":
                wanted = f"{obstacle.avoid:.3g} mm wanted"
                figures[name]["wanted"] = obstacle.avoid
                lines.append(f"{name}: the robot came within {least:.3g} mm, {wanted}")
                continue
            missed = np.abs(x[:, row] - obstacle.press) if obstacle.press else np.zeros(0)
            text = f"{name}: pressed with {least:.4g} to {most:.4g} N"
            if len(missed):
                figures[name] |= {"wanted": obstacle.press, "error_mean": missed.mean(), "error_max": missed.max()}
                met = int((missed <= PRESSED * obstacle.press).sum())
                text += f" where {obstacle.press:.3g} N are wanted: held at {met} of {len(missed)} goals"
                text += f" (error mean {missed.mean():.2g} N, max {missed.max():.2g} N)"
            largest = obstacle.largest_force
            lines.append(text + (f"; at most {largest:.3g} N allowed" if largest else ""))
        return figures, lines


def world_of(spec: ObstaclesSpec, obstacles: ReadObstacles, model: ContactModel) -> ObstacleWorld:
    """World that the spec asks for at its obstacles; model: says how stiff the robot is, which weighs forces against
    places."""
    pressed = [spec.obstacles[name] for name in obstacles.pressed]
    avoided = [spec.obstacles[name] for name in obstacles.avoided]
    rest = [0.0] * len(avoided)
    goal = np.array([obstacle.press or 0.0 for obstacle in pressed] + rest)
    weights = np.array([0.0 if obstacle.press is None else 1 / model.stiffness for obstacle in pressed] + rest)
    largest = [np.inf if obstacle.largest_force is None else obstacle.largest_force for obstacle in pressed]
    bounds = [[-np.inf, force] for force in largest] + [[obstacle.avoid, np.inf] for obstacle in avoided]
    return ObstacleWorld(model.rows, goal, weights, np.array(bounds).reshape(-1, 2))
