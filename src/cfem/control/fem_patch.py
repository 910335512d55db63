"""The FE robot whose contact points a rigid patch holds, as a model of its actuators and the patch's pose."""

import time
from collections import deque

import numpy as np

from cfem.condensed import Condensed
from cfem.condensed.restrict import onto_patch
from cfem.core.errors import NumericalError
from cfem.equilibrium.actuation import displacement
from cfem.equilibrium.held_patch import contact_points, held, patch_of
from cfem.equilibrium.newton import Settings
from cfem.equilibrium.predictor import Knot, is_new, knot, predict
from cfem.equilibrium.problem import Problem
from cfem.equilibrium.robot import Robot
from cfem.equilibrium.solution import Equilibrium
from cfem.equilibrium.solve import solve

MEMORY = 100  # solved states that predictions draw on
APART = 1e-3  # mm or rad: states nearer to each other teach nothing new


class FemPatch:
    """patch: as the robot's contact points make it; x: (n, 3) mm nodes now; solves, seconds: what it has cost;
    settings: of Newton's method"""

    def __init__(self, robot: Robot, turns: bool, tolerance: float = 1e-11):
        self._problem = Problem(robot)
        self.rows = robot.rows
        self.patch = patch_of(contact_points(self._problem), turns)
        self._settings = Settings(tolerance=tolerance)
        self._last: Equilibrium | None = None
        self._at: tuple[np.ndarray, Condensed] | None = None
        self._known: deque[Knot] = deque(maxlen=MEMORY)
        self.solves, self.factorizations, self.seconds = 0, 0, 0.0

    @property
    def x(self) -> np.ndarray:
        return self._problem.rest if self._last is None else self._last.state.x

    def at_displacement(self, delta: np.ndarray) -> Condensed:
        """Condensed FE at delta (n_a + n,): actuators (mm), bilateral, then the patch's pose. NumericalError where it
        does not converge to a stable equilibrium."""
        delta = np.asarray(delta, float)
        if self._at is not None and np.array_equal(self._at[0], delta):
            return self._at[1]
        begin = time.perf_counter()
        n_a = self.rows.n_a
        X = delta[n_a:]
        actuation = held(displacement(delta[:n_a]), self.patch.displacement(X))
        base = None if self._last is None else self._last.state
        start = predict(self._known, delta, actuation)
        found = solve(self._problem, actuation, start, base, settings=self._settings, slack=False)
        self.solves += 1
        self.factorizations += found.factorizations
        self.seconds += time.perf_counter() - begin
        if not found.converged:
            raise NumericalError(f"FE robot: {found.status.value}")
        self._last = found
        candidate = knot(delta, found, contacts=True)
        if is_new(self._known, candidate, APART):
            self._known.append(candidate)
        self._at = delta.copy(), onto_patch(found.condensed, self.patch, X)
        return self._at[1]
