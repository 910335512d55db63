"""FE robots and an object that they only touch, as the plant: contact points open, stick and slide."""

from collections.abc import Sequence

import numpy as np

from cfem.contact.problem import Law
from cfem.equilibrium.actuation import displacement
from cfem.equilibrium.grip import Free, grip
from cfem.equilibrium.touch import PlacedRobot
from cfem.plant.contact_account import ContactAccount
from cfem.plant.protocol import Command, Measurement
from cfem.plant.quasi_static import carried_out

LONGEST = 1.0  # mm that an actuator goes in one quasi-static step: friction depends on the way


class GripPlant(ContactAccount):
    """`Plant`. ends: where each robot's actuators begin and end; object_points (k, 3) mm of the object at rest, which
    `x` shows behind the robots' nodes; grasp: (n_a,) mm, how the first command begins, so that something is held."""

    def __init__(
        self,
        fingers: Sequence[PlacedRobot],
        ends: np.ndarray,
        held: Free,
        law: Law,
        mu: float,
        object_points: np.ndarray,
        grasp: np.ndarray | None = None,
    ):
        self._fingers, self._ends, self._held, self._law, self._mu = fingers, ends, held, law, mu
        self._object_points, self._grasp = object_points, grasp
        self._at, self._last = np.zeros(int(ends[-1])), None
        super().__init__()

    @property
    def x(self) -> np.ndarray:
        """(n, 3) mm nodes of all robots, one after the other, and the points of the object."""
        last = self._last
        if last is None:
            nodes = [one.problem.rest @ one.turn.T + one.shift for one in self._fingers]
            return np.concatenate([*nodes, self._object_points])
        solved = zip(self._fingers, last.solved, strict=True)
        nodes = [one.state.x @ finger.turn.T + finger.shift for finger, one in solved]
        return np.concatenate([*nodes, last.around.now(self._object_points)])

    def step(self, u: np.ndarray, kind: Command = "displacement") -> Measurement:
        """Displacements (n_a,) mm, in quasi-static steps; where a step fails it is halved, and where the shortest fails
        the state is the last one that was found, and the status says why."""
        self.commands += 1
        if self._last is None and self._grasp is not None:
            self._towards(self._grasp)
        status = self._towards(np.asarray(u, float))
        if status != "converged":
            self.failures += 1
        last = self._last
        if last is None or kind != "displacement":
            return Measurement.failed(3, len(self._at), self.commands, status)
        self.seen(last)
        delta_a, lambda_a = (
            np.concatenate([getattr(one, key) for one in last.solved]) for key in ("delta_a", "lambda_a")
        )
        return Measurement(self._held.centre + last.around.x, delta_a, lambda_a, self.commands, status)

    def _towards(self, u: np.ndarray) -> str:
        """How it ended."""
        return carried_out(self._at, u, LONGEST, self._go)

    def _go(self, u: np.ndarray) -> str:
        parts = [displacement(u[a:b]) for a, b in zip(self._ends[:-1], self._ends[1:], strict=True)]
        found = grip(self._fingers, parts, self._held, self._law, self._mu, self._last)
        self.steps += 1
        self.iterations += found.iterations
        if found.converged:
            self._last, self._at = found, u
        return found.status.value
