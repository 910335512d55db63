"""The FE robot as a model and as a plant: the reference that learned control is compared with, and what it
acts on."""

import time
from collections import deque
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from cfem.condensed import Condensed
from cfem.control.plant import Command, Measurement
from cfem.core.errors import NumericalError
from cfem.equilibrium.actuation import Actuation, displacement, force, pull
from cfem.equilibrium.predictor import Knot, is_new, knot, predict
from cfem.equilibrium.problem import Problem
from cfem.equilibrium.robot import Robot
from cfem.equilibrium.solution import Equilibrium
from cfem.equilibrium.solve import solve

MEMORY = 200  # solved states that predictions draw on
APART = 0.01  # of the reach: states nearer to each other than this teach nothing new


def pushed(robot: Robot, push: np.ndarray) -> Robot:
    """The robot under forces push (n_e,) N on its effectors: dead loads on the nodes that they follow at rest."""
    loads = np.zeros_like(robot.X) if robot.loads is None else robot.loads.copy()
    first = 0
    for effector in robot.effectors:
        rows = slice(first, first + len(effector.rest))
        np.add.at(loads, effector.nodes, np.einsum("r,rki->ki", push[rows], effector.gradient(robot.X)))
        first = rows.stop
    return replace(robot, loads=loads)


class FemPlant:
    """Both protocols, `Model` and `Plant`, on one FE robot. Every solve starts from a prediction from the
    states solved before, which costs about one factorisation where they are near; a step to where the robot
    stands costs nothing.

    solves, factorizations, seconds: what it has cost; x: (n, 3) mm nodes now"""

    def __init__(self, robot: Robot):
        self._problem = Problem(robot)
        self._last: Equilibrium | None = None
        self._known: deque[Knot] = deque(maxlen=MEMORY)
        self._t = 0
        self.solves, self.factorizations, self.seconds = 0, 0, 0.0

    @property
    def x(self) -> np.ndarray:
        return self._problem.rest if self._last is None else self._last.state.x

    @property
    def state(self) -> Equilibrium | None:
        """The equilibrium in which the robot stands, None at rest."""
        return self._last

    def at_displacement(self, delta_a: np.ndarray) -> Condensed:
        """Condensed FE at delta_a (n_a,) mm, all actuators bilateral, as the linearisation of the inverse step
        sees them."""
        delta_a = np.asarray(delta_a, float)
        if not self._stands_at(delta_a):
            self._solve(displacement(delta_a), delta_a, slack=False)
        return self._last.condensed

    def step(self, u: ArrayLike, kind: Command = "displacement") -> Measurement:
        """Actuators that would have to push go slack."""
        self._t += 1
        u = np.asarray(u, float)
        try:
            if kind == "force":
                self._solve(force(u), self._stand, slack=True)
            elif not self._stands_at(u) or self._pushes():
                self._solve(displacement(u), u, slack=True)
        except NumericalError as error:
            nothing = np.full(len(u), np.nan)
            rest = self._problem.robot.rest_e
            return Measurement(np.full(len(rest), np.nan), nothing, nothing, self._t, str(error))
        return self._measurement()

    def pull(self, share: np.ndarray) -> Measurement:
        """The state of one point of the pulling cube [0, 1]^n_a, smooth in it (the share-weighted mean displacement is
        the share-weighted mean share). NumericalError where it is out of reach."""
        reach_max = self._problem.robot.reach[:, 1]
        self._t += 1
        amount = float(share @ share / share.sum()) if share.any() else 0.0
        self._solve(pull(share, reach_max, amount), share * reach_max, slack=True)
        return self._measurement()

    @property
    def _stand(self) -> np.ndarray:
        """(n_a,) mm actuator displacements now."""
        return np.zeros(self._problem.robot.rows.n_a) if self._last is None else self._last.delta_a

    def _solve(self, actuation: Actuation, near: np.ndarray, slack: bool) -> None:
        """near: (n_a,) mm, about where the actuators will be. NumericalError where it does not converge."""
        begin = time.perf_counter()
        base = None if self._last is None else self._last.state
        found = solve(self._problem, actuation, predict(self._known, near, actuation), base, slack=slack)
        self.solves += 1
        self.factorizations += found.factorizations
        self.seconds += time.perf_counter() - begin
        if not found.converged:
            raise NumericalError(f"FE robot: {found.status.value}")
        self._last = found
        candidate = knot(found.delta_a, found)
        if is_new(self._known, candidate, APART * float(np.abs(self._problem.robot.reach).max())):
            self._known.append(candidate)

    def _stands_at(self, delta_a: np.ndarray) -> bool:
        return self._last is not None and bool(np.abs(self._last.delta_a - delta_a).max() < 1e-9)

    def _pushes(self) -> bool:
        lam = self._last.lambda_a
        return bool((self._problem.robot.unilateral & (lam < -1e-9 * np.abs(lam).max())).any())

    def _measurement(self) -> Measurement:
        last = self._last
        x_e = self._problem.robot.rest_e + last.delta_e
        return Measurement(x_e, last.delta_a, last.lambda_a, self._t, "converged")
