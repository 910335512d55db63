"""Several FE robots and the object that they hold as the plant: every robot in full, the object's balance solved to
rounding. No condensed model of it is older than the state that it is asked for."""

from collections.abc import Sequence

import numpy as np

from cfem.condensed.coupling import Coupled, HeldObject, Holder, RigidObject
from cfem.condensed.pose import turn
from cfem.core.errors import NumericalError
from cfem.equilibrium.problem import Problem
from cfem.plant.fem_patch import FemPatch
from cfem.plant.protocol import Changing, Command, Measurement

PUSH = 1e-7  # N, or 1e-6 of the largest tension: what a cable may seem to push by the search's tolerance
ITERATIONS = 20


class CoupledPlant:
    """`Model` and `Plant`. unilateral: (n_a,) actuators that pull and do not push; shape: (k, 3) mm points of the
    object at rest, which `x` shows behind the robots' nodes.

    imbalance: the largest force or moment sum on the object of all states so far, relative; softest: the smallest
    eigenvalue of the stiffness that holds it over the largest, in all of them; updates: of its pose that they took"""

    def __init__(
        self, holds: Sequence[Holder], held: RigidObject, unilateral: np.ndarray, home: np.ndarray, shape: np.ndarray
    ):
        """Glues the robots of `holds` to the object `held`; unilateral, home (n_a,): actuators that only pull, and
        where plans begin; shape: points of the object."""
        self.coupled = Coupled(holds, held, home)
        self._fem: list[FemPatch] = [hold.model for hold in holds]
        self._unilateral, self._t = unilateral, 0
        self.home = home
        self._shape = shape
        self._last: HeldObject | None = None
        self.imbalance, self.softest, self.updates = 0.0, np.inf, 0

    @property
    def changing(self) -> Changing:
        own_state = [(self, ("_last", "_t", "imbalance", "softest", "updates")), (self.coupled, ("_last", "_slope"))]
        return [*own_state, *(pair for patch in self._fem for pair in patch.changing)]

    @property
    def problems(self) -> list[Problem]:
        return [problem for patch in self._fem for problem in patch.problems]

    @property
    def solves(self) -> int:
        return sum(patch.solves for patch in self._fem)

    @property
    def seconds(self) -> float:
        return sum(patch.seconds for patch in self._fem)

    @property
    def x(self) -> np.ndarray:
        """(n, 3) mm nodes of all robots, one after the other, and the points of the object."""
        parts = zip(self.coupled.holds, self._fem, strict=True)
        robots = [patch.x @ hold.turn.T + hold.shift for hold, patch in parts]
        return np.concatenate([*robots, self._object()])

    def at_displacement(self, delta_a: np.ndarray) -> HeldObject:
        held = self._last = self.coupled.at_displacement(delta_a)
        self.imbalance, self.softest = max(self.imbalance, *held.balance), min(self.softest, held.softest)
        self.updates += held.updates
        return held

    def step(self, u: np.ndarray, kind: Command = "displacement") -> Measurement:
        """Displacements (n_a,) mm; actuators that would have to push go slack."""
        self._t += 1
        n_e = len(self.coupled.rows.effectors)
        try:
            if kind != "displacement":
                raise NumericalError("the coupled plant takes displacements")
            held = self._without_push(np.asarray(u, float))
        except NumericalError as error:
            return Measurement.failed(n_e, len(u), self._t, str(error))
        x_e = self.coupled.object.rest_e + held.delta_e
        return Measurement(x_e, held.delta_a, held.lambda_a, self._t, "converged")

    def _object(self) -> np.ndarray:
        if self._last is None:
            return self._shape
        X, centre = self._last.X, self.coupled.object.centre
        arms = self._shape - centre
        return centre + X[:3] + (arms @ turn(X[3:]).R.T if len(X) == 6 else arms)

    def _without_push(self, u: np.ndarray) -> HeldObject:
        """The state at u with every actuator that would push let go until it carries nothing."""
        slack, delta = np.zeros(len(u), dtype=bool), u.copy()
        for _ in range(ITERATIONS):
            held = self.at_displacement(delta)
            lam = held.lambda_a
            allowed = max(PUSH, 1e-6 * float(np.abs(lam).max()))
            pushes = self._unilateral & (lam < -allowed)
            tight = slack & (delta < u)  # the actuator is longer than it was let: it pulls again
            if not (pushes | tight).any() and np.abs(lam[slack]).max(initial=0.0) <= allowed:
                return held
            slack = (slack | pushes) & ~tight
            delta = np.where(slack, delta, u)
            if slack.any():
                K = np.linalg.inv(held.W_aa)
                moved = lam + K @ (delta - held.delta_a)
                delta[slack] -= np.linalg.solve(K[np.ix_(slack, slack)], moved[slack])
        raise NumericalError("no consistent set of slack actuators was found")
