"""The FE robot whose contact points a rigid patch holds, as a model of its actuators and the patch's pose, and several
of them that hold one object."""

import numpy as np

from cfem.condensed import Condensed
from cfem.condensed.coupling import Coupled
from cfem.condensed.pose import onto_patch
from cfem.equilibrium.contact.held_patch import contact_points, held, patch_of
from cfem.equilibrium.newton import NewtonSettings
from cfem.equilibrium.system.actuation import displacement
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.robot import Robot
from cfem.plant.fem_robot import FemRobot
from cfem.plant.protocol import Changing

MEMORY = 100  # solved states that predictions draw on
APART = 1e-3  # mm or rad: states nearer to each other teach nothing new
TOLERANCE = 1e-11  # of Newton's method


class FemPatch(FemRobot):
    """`Model` of the actuators and the pose of a patch, by finite elements. patch: as the robot's contact points make
    it."""

    def __init__(self, robot: Robot, turns: bool):
        super().__init__(robot, MEMORY, APART, NewtonSettings(tolerance=TOLERANCE))
        self.rows = robot.rows
        self.patch = patch_of(contact_points(self._problem), turns)
        self._at: tuple[np.ndarray, Condensed] | None = None

    @property
    def changing(self) -> Changing:
        return [*super().changing, (self, ("_at",))]

    def at_displacement(self, delta: np.ndarray) -> Condensed:
        """Condensed FE at delta (n_a + n,): actuators (mm), bilateral, then the patch's pose. NumericalError where it
        does not converge to a stable equilibrium."""
        delta = np.asarray(delta, float)
        if self._at is not None and np.array_equal(self._at[0], delta):
            return self._at[1]
        n_a = self.rows.n_a
        X = delta[n_a:]
        actuation = held(displacement(delta[:n_a]), self.patch.displacement(X))
        same_actuation = self._at is not None and np.array_equal(self._at[0][:n_a], delta[:n_a])
        equilibrium = self._solve(actuation, delta, slack=False, place=delta, again=same_actuation)
        self._at = delta.copy(), onto_patch(equilibrium.condensed, self.patch, X)
        return self._at[1]


class CoupledFem(Coupled):
    """FE robots that are glued to an object: what control by FE matrices plans with. Each is a `FemPatch`.

    solves, factorizations, seconds: what all of them have cost"""

    @property
    def changing(self) -> Changing:
        own_state: Changing = [(self, ("_last", "_slope"))]
        return own_state + [pair for hold in self.holds for pair in hold.model.changing]

    @property
    def problems(self) -> list[Problem]:
        return [problem for hold in self.holds for problem in hold.model.problems]

    @property
    def solves(self) -> int:
        return sum(hold.model.solves for hold in self.holds)

    @property
    def factorizations(self) -> int:
        return sum(hold.model.factorizations for hold in self.holds)

    @property
    def seconds(self) -> float:
        return sum(hold.model.seconds for hold in self.holds)
