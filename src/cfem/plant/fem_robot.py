"""One FE robot that is solved again and again, each time near states that it has been in."""

import time
from collections import deque

import numpy as np

from cfem.core.errors import NumericalError
from cfem.equilibrium.newton import NewtonSettings
from cfem.equilibrium.predictor import Knot, is_new, knot, predict
from cfem.equilibrium.solve import DEFAULT, solve
from cfem.equilibrium.system.actuation import Actuation, pulling_only
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.robot import Robot
from cfem.equilibrium.system.solution import Equilibrium
from cfem.plant.protocol import Changing


class FemRobot:
    """A finite-element robot that is solved again and again. Every solve starts from a prediction from the states
    solved before, which costs about one factorisation where they are near.

    solves, factorizations, seconds: what it has cost; x: (n, 3) mm nodes now; state: the equilibrium in which the robot
    stands, None at rest"""

    def __init__(self, robot: Robot, memory: int, apart: float, settings: NewtonSettings = DEFAULT):
        """Begins at rest. memory: solved states that predictions draw on; apart: states nearer to each other teach
        nothing new; settings: of Newton's method."""
        self._problem = Problem(robot)
        self._settings, self._apart = settings, apart
        self._known: deque[Knot] = deque(maxlen=memory)
        self.state: Equilibrium | None = None
        self.solves, self.factorizations, self.seconds = 0, 0, 0.0

    @property
    def changing(self) -> Changing:
        return [(self, ("_known", "state", "solves", "factorizations", "seconds"))]

    @property
    def problems(self) -> list[Problem]:
        return [self._problem]

    @property
    def x(self) -> np.ndarray:
        return self._problem.rest if self.state is None else self.state.state.x

    def _solve(
        self, actuation: Actuation, near: np.ndarray, slack: bool, place: np.ndarray | None = None, again: bool = False
    ) -> Equilibrium:
        """Equilibrium of the robot under an actuation. NumericalError where it does not converge to a stable one.

        near: (n,) about where the robot will be
        place: (n,) where it then is, contact points held; None: where its actuators stand
        again: whether it moves so little from the last state that its factor serves on"""
        begin = time.perf_counter()
        base = None if self.state is None else self.state.state
        if slack:
            actuation = pulling_only(actuation, self._problem.robot.unilateral)
        start = predict(self._known, near, actuation, shape=None if again else self._problem.rotation_strain)
        tangent = self._problem.latest if again else None
        equilibrium = solve(
            self._problem, actuation, start, base, settings=self._settings, slack=slack, tangent=tangent
        )
        self.solves += 1
        self.factorizations += equilibrium.factorizations
        self.seconds += time.perf_counter() - begin
        if not equilibrium.converged:
            raise NumericalError(f"FE robot: {equilibrium.status.value}")
        self.state = equilibrium
        candidate = knot(equilibrium.delta_a if place is None else place, equilibrium, contacts=place is not None)
        if is_new(self._known, candidate, self._apart):
            self._known.append(candidate)
        return equilibrium
