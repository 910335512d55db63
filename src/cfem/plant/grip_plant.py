"""Robots and an object that they hold, as the plant (`cfem.plant.grip_walk`)."""

from collections.abc import Sequence

import numpy as np

from cfem.contact.clearance import nearest_of_surface
from cfem.contact.law.problem import Law
from cfem.equilibrium.contact.grasp import FreeObject
from cfem.equilibrium.contact.ground import Pads
from cfem.equilibrium.contact.points import PlacedRobot, PointRobot
from cfem.equilibrium.contact.surface_robot import PlacedSurface
from cfem.equilibrium.quasi_static import CONVERGED
from cfem.equilibrium.system.problem import Problem
from cfem.plant.grip_walk import GripWalk
from cfem.plant.protocol import Changing, Command, Measurement


class GripPlant(GripWalk):
    """`Plant` of robots that grip an object, glued or by unilateral contact.

    margins: to slip while the robots hold the object, after each command
    borne: N by the table, after each command
    imbalance: of a glued object, the largest force or moment sum on it so far, relative
    softest: of a glued object, the smallest eigenvalue of the stiffness that holds it over the largest, in all
        states"""

    def __init__(
        self,
        fingers: Sequence[PointRobot],
        ends: np.ndarray,
        held: FreeObject,
        law: Law,
        mu: float,
        object_points: np.ndarray,
        grasp: np.ndarray | None = None,
        margin: float | None = None,
        table: Pads | None = None,
        longest: np.ndarray | float = 1.0,
    ):
        """Grip at rest, by the arguments of `GripWalk` and more.

        object_points: (k, 3) mm of the object at rest, which `x` shows behind the robots' nodes
        margin: None, or x_e has behind the object's place what each robot's grip has left (`effectors`)"""
        super().__init__(fingers, ends, held, law, mu, grasp, table, longest)
        self._object_points, self._margin = object_points, margin
        self.margins: list[float] = []
        self.borne: list[float] = []
        self.imbalance, self.softest = 0.0, np.inf

    @property
    def changing(self) -> Changing:
        figures = ("margins", "borne", "imbalance", "softest", "stuck", *self.COUNTED)
        return [(self, ("at", "load", "carried", "choices", "last", *figures))]

    @property
    def problems(self) -> list[Problem]:
        return [finger.problem for finger in self.fingers]

    @property
    def x(self) -> np.ndarray:
        """Nodes (n, 3) mm of all FE robots, one after the other, and the points of the object."""
        last = self.last
        if last is None:
            nodes = [finger.problem.rest @ finger.turn.T + finger.shift for finger in self.fingers]
            return np.concatenate([*nodes, self._object_points])
        solved = zip(self.fingers, self.solved, strict=True)
        nodes = [state.state.x @ finger.turn.T + finger.shift for finger, state in solved]
        return np.concatenate([*nodes, last.around.now(self._object_points)])

    def step(self, u: np.ndarray, kind: Command = "displacement", via: Sequence[np.ndarray] = ()) -> Measurement:
        """Measurement after displacements (n_a,) mm, by way of those in `via`, in quasi-static steps; from the first of
        these on robots let go of an object that they put down. A step that fails is halved, and where the shortest
        fails the state is the last that converged, and the status says why."""
        self.commands += 1
        n_e = len(self._held.delta_e) + (0 if self._margin is None else len(self.fingers))
        if kind != "displacement":
            return Measurement.failed(n_e, len(u), self.commands, "robots that hold an object take displacements")
        for finger in self.fingers:
            if isinstance(finger, PlacedRobot):
                finger.forget()  # an interrupted run goes on to the same figures
        status = self.grasp()
        status = CONVERGED if status == CONVERGED else f"grasp: {status}"
        first, *further = (np.asarray(target, float) for target in (*via, u))
        status = self.towards(first) if status == CONVERGED else status
        status = self.towards(further[-1], further[:-1]) if further and status == CONVERGED else status
        if status != CONVERGED:
            self.failures += 1
        last = self.last
        if last is None:
            return Measurement.failed(n_e, len(self.at), self.commands, status)
        self.seen(last.modes, last.check.largest if last.check else 0.0)
        self._count_grip()
        for finger, state in zip(self.fingers, self.solved, strict=True):
            if isinstance(finger, PlacedSurface):
                surface, triangles = finger.of.surface(state.state.x), finger.of.triangles
                depth = -nearest_of_surface(surface, triangles, last.around.placed).distance
                self.deepest = max(self.deepest, (depth, "the object"))
        delta_a, lambda_a = (
            np.concatenate([getattr(state, key) for state in self.solved]) for key in ("delta_a", "lambda_a")
        )
        return Measurement(self.effectors(), delta_a, lambda_a, self.commands, status)

    def _count_grip(self) -> None:
        """Counts how the object is held as it stands: balance and stiffness of glue, else the margin to slip, where the
        robots hold it, and what the table bears."""
        if self.glued:
            stiffness = self._stiffness(self.last)
            self.imbalance = max(self.imbalance, self.last.check.balance)
            self.softest = min(self.softest, float(stiffness[0] / stiffness[-1]))
            return
        if self.holds:
            self.margins.append(self.slip_margin())
        self.borne.append(self.on_table())

    def account(self) -> dict:
        glue = {"imbalance": self.imbalance, "softest": self.softest} if self.glued else {}
        return super().account() | glue

    def sentence(self) -> str:
        if not self.glued:
            return super().sentence()
        return (
            f"object: forces and moments balance to {self.imbalance:.1e} of their size in every glued state; "
            f"in its softest direction it is held with {self.softest:.1e} of the stiffness of its stiffest"
        )

    def effectors(self) -> np.ndarray:
        """Values (n_e,) mm, rad and N of the goal rows: the object's place, its rotation vector where it is oriented,
        and what each grip has left, mu N - margin |T|, where that is asked for."""
        place = self.last.around.delta_e
        place = np.concatenate([self._held.centre + place[:3], place[3:]])
        if self._margin is None:
            return place
        normal, friction = self.pushes()
        return np.concatenate([place, self._mu * normal - self._margin * np.linalg.norm(friction, axis=1)])
