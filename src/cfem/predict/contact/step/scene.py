"""Learned robots that touch rigid obstacles, each other and themselves with any part of their surface, with friction,
at actuators that are held. One robot among obstacles is the case of one body.

Signed distances of patches from obstacles, pairs of a patch and the soft surface before it (`cfem.contact.pairs`), and
the compliance of all patches that touch (`cfem.predict.contact.surface.patched_model`) make one linear contact problem
(`cfem.contact`), which is solved exactly. It is posed again where the patches have come to, until neither forces nor
what touches change (`cfem.predict.contact.step.rounds`). The forces of the actuators follow from the energy of the
loaded robot, Psi - w . s_0 - w . C_ss w / 2 (`cfem.predict.loads.loaded`). Nothing is retrained: two robots are two
models.

A step begins where the last one ended: on which side of an edge a patch has come to lie, who is before whom, and where
friction holds depends on the way."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cfem.contact.obstacle import Obstacle
from cfem.contact.obstacle_set import ObstacleSet
from cfem.contact.step_status import StepStatus
from cfem.core.errors import InputError
from cfem.equilibrium.quasi_static import all_carried_out
from cfem.predict.contact.step.bodies import Bodies, PlacedModel
from cfem.predict.contact.step.rounds import Rounds
from cfem.predict.contact.step.slack import with_slack
from cfem.predict.contact.step.state import ContactState
from cfem.predict.contact.surface.surface_model import SurfaceModel

INSIDE = 1e-3  # of the length: by how much robots may overlap where they begin
SHARE = 0.05  # of its reach: the longest way of an actuator in one step


@dataclass(frozen=True, eq=False)
class ContactScene(Bodies):
    """`Bodies` that go on in quasi-static steps."""

    def go(self, deltas: Sequence[np.ndarray], before: ContactState | None = None) -> ContactState:
        """Goes to deltas, (n_a,) mm each, in steps from the state `before` (none: actuators at 0); one that fails is
        halved. Never raises for numerical failure: the state where it ended says why. InputError where robots overlap
        at the begin."""
        before = self.start([np.zeros(len(delta)) for delta in deltas]) if before is None else before
        longest = [SHARE * np.abs(robot.patched.model.reach).max(axis=1) for robot in self.robots]
        ends = [np.asarray(delta, float) for delta in deltas]
        begins = [  # a slack cable is where no target above it has been
            np.where(lam == 0.0, np.minimum(begin, end), begin) if robot.unilateral is not None else begin
            for robot, begin, end, lam in zip(self.robots, before.deltas, ends, before.lambda_a, strict=True)
        ]
        return all_carried_out(begins, ends, longest, before, self.step)

    def start(self, deltas: Sequence[np.ndarray]) -> ContactState:
        """First state, with nothing pressed yet. InputError where soft surfaces may touch, and overlap there."""
        rounds = Rounds(self, deltas, None)
        if self.soft and rounds.gap < -INSIDE * self.length:
            where = "are at 0" if not any(np.any(delta) for delta in deltas) else "begin"
            raise InputError(
                f"the robots overlap by {-rounds.gap:.3g} mm where their actuators {where}", do="move one of them"
            )
        return rounds.run()

    def step(
        self, deltas: Sequence[np.ndarray], before: ContactState | None, of_first: np.ndarray | None = None
    ) -> ContactState:
        """One quasi-static step from the state `before` (none: free robots), which ends as `go` does. of_first (n_a,)
        bool: `unilateral` of the first robot now."""
        unilateral, surfaces = self.unilateral, self.surfaces
        if of_first is not None:
            unilateral = np.concatenate([of_first, unilateral[len(of_first) :]])

        def held(target: np.ndarray) -> ContactState:
            return Rounds(self, [target[a:b] for a, b in surfaces.actuator_ends], before).run()

        target = np.concatenate(deltas, dtype=float)
        if not self.pulls and of_first is None:
            return held(target)
        last = None if before is None else (before.given[: len(target)], before.pull)
        state, slack, settled = with_slack(held, surfaces.predictors, unilateral, target, last)
        if settled and not slack.any():
            return state
        status = state.status if settled else StepStatus.ITERATIONS
        answers = state.answers._replace(pull=np.where(slack, 0.0, state.pull))
        return replace(state, status=status, answers=answers)


def contact_step(
    patched: SurfaceModel,
    delta_a: np.ndarray,
    obstacles: Sequence[Obstacle] | ObstacleSet,
    mu: float = 0.0,
    before: ContactState | None = None,
    unilateral: np.ndarray | None = None,
    parts: int = 1,
) -> ContactState:
    """`ContactScene.step` of one robot among obstacles in its own frame, to delta_a (n_a,) mm; unilateral (n_a,)
    bool."""
    scene = ContactScene([PlacedModel(patched, itself=False)], ObstacleSet.of(obstacles), mu, parts=parts)
    return scene.step([delta_a], before, unilateral)
