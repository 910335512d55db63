"""The FE robot as a model and as a plant: the reference that learned control is compared with, and what it
acts on."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import ArrayLike

from cfem.condensed import Condensed
from cfem.constraint.patch import PatchLoad
from cfem.core.errors import NumericalError
from cfem.equilibrium.contact.patch_effectors import with_patches
from cfem.equilibrium.predictor import following, predict
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import displacement, force, pull
from cfem.equilibrium.system.robot import Robot, demand_without_discrepancy
from cfem.plant.fem_robot import FemRobot
from cfem.plant.protocol import Changing, Command, Measurement, command_of
from cfem.sample.plan import borne, borne_together

MEMORY = 200  # solved states that predictions draw on
_LESS, _WITHIN = 8, 0.99  # pulls tried that become less, the last of them to this share of the reach
_NOTHING = 1e-6  # of the reach, by which a displacement may lie below it
APART = 0.01  # of the reach: states nearer to each other than this teach nothing new


def pushed(robot: Robot, push: np.ndarray, patches: Sequence[PatchLoad] = ()) -> Robot:
    """Robot under forces push (n_e,) N on its effectors and on patches of its surface: dead loads on the nodes that
    they follow at rest. SpecError where a patch is not on the surface."""
    if push.any() or patches:
        demand_without_discrepancy(robot, "loads")
    loads = np.zeros_like(robot.X) if robot.loads is None else robot.loads.copy()
    push, first = np.concatenate([push, *(patch.force for patch in patches)]), 0
    for effector in with_patches(robot, patches).effectors:
        rows = slice(first, first + len(effector.rest))
        np.add.at(loads, effector.nodes, np.einsum("r,rki->ki", push[rows], effector.gradient(robot.X)))
        first = rows.stop
    return replace(robot, loads=loads)


class FemPlant(FemRobot):
    """A finite-element robot as a `Model` and as a `Plant`. A step to where it stands costs nothing."""

    def __init__(self, robot: Robot):
        super().__init__(robot, MEMORY, APART * float(np.abs(robot.reach).max()))
        self._t = 0

    @property
    def changing(self) -> Changing:
        return [*super().changing, (self, ("_t",))]

    def at_displacement(self, delta_a: np.ndarray) -> Condensed:
        """Condensed FE at delta_a (n_a,) mm, all actuators bilateral, as the linearisation of the inverse step
        sees them."""
        delta_a = np.asarray(delta_a, float)
        if not self._stands_at(delta_a):
            self._solve(displacement(delta_a), delta_a, slack=False)
        return self.state.condensed

    def step(self, u: ArrayLike, kind: Command = "displacement") -> Measurement:
        """Actuators that would have to push go slack."""
        u = command_of(u, self._problem.robot.rows.n_a)
        self._t += 1
        try:
            if kind == "force":
                self._solve(force(u), self._stand, slack=True)
            elif not self._stands_at(u) or self._pushes():
                self._solve(displacement(u), u, slack=True)
        except NumericalError as error:
            return Measurement.failed(self._problem.robot.rows.n_e, len(u), self._t, str(error))
        return self._measurement()

    def pull(self, share: np.ndarray) -> Measurement:
        """The state of one point of the pulling cube [0, 1]^n_a: the share-weighted mean displacement is the
        share-weighted mean share, or less where an actuator would go beyond its reach, as one does against which others
        pay out, or the body would not bear so much of all at once. An actuator that would pay out beyond its lower
        reach is held there. NumericalError where there is no such state."""
        reach_max = self._problem.robot.reach[:, 1]
        self._t += 1
        amount = 0.0
        if share.any():
            amount = borne(share, reach_max, *self._pull_together, float(share @ share / share.sum()))
        for _ in range(_LESS):
            self._solve(pull(share, reach_max, amount), share * reach_max, slack=True)
            if self._used() <= 1.0:
                self._hold_at_lower_reach()
            if self._used() <= 1.0:
                return self._measurement()
            amount *= _WITHIN / self._used()
        raise NumericalError(f"FE robot: a pull in the shares {np.round(share, 3).tolist()} leaves the reach")

    def _used(self) -> float:
        """The largest displacement now, as a share of the upper reach."""
        return float((self.state.delta_a / self._problem.robot.reach[:, 1]).max())

    def _hold_at_lower_reach(self) -> None:
        """The state whose actuators stand where they do now, those below their reach excepted, which are at its end."""
        low, high = self._problem.robot.reach.T
        held = np.maximum(self.state.delta_a, low)
        if (held - self.state.delta_a > _NOTHING * (high - low)).any():
            self._solve(displacement(held), held, slack=True)

    @cached_property
    def _pull_together(self) -> tuple[np.ndarray, float]:
        """Compliance (n_a, n_a) mm/N at rest, and the share of their reach that all actuators bear at once."""
        n_a, reach_max = self._problem.robot.rows.n_a, self._problem.robot.reach[:, 1]
        compliance = solve(self._problem, force(np.zeros(n_a))).condensed.W_aa
        start = partial(predict, shape=self._problem.rotation_strain)
        pulled = following(lambda asked, state: solve(self._problem, asked, state), start)
        return compliance, borne_together(pulled, reach_max, compliance)

    @property
    def _stand(self) -> np.ndarray:
        """Displacements (n_a,) mm of the actuators now."""
        return np.zeros(self._problem.robot.rows.n_a) if self.state is None else self.state.delta_a

    def _stands_at(self, delta_a: np.ndarray) -> bool:
        return self.state is not None and bool(np.abs(self.state.delta_a - delta_a).max() < 1e-9)

    def _pushes(self) -> bool:
        lam = self.state.lambda_a
        return bool((self._problem.robot.unilateral & (lam < -1e-9 * np.abs(lam).max())).any())

    def _measurement(self) -> Measurement:
        last = self.state
        x_e = self._problem.robot.rest_e + last.delta_e
        return Measurement(x_e, last.delta_a, last.lambda_a, self._t, "converged")
