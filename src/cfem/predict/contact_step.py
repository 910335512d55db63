"""Quasi-static steps of the contact of one learned robot: with rigid obstacles alone (`cfem.predict.touching`), or with
other soft robots and itself too (`cfem.predict.meeting`)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from cfem.contact.obstacle_set import ObstacleSet
from cfem.contact.prescribed_motion import PrescribedMotion
from cfem.predict.meeting import Meeting, Met
from cfem.predict.touchable import Touchable
from cfem.predict.touching import Touched, touch_step


class Steps(Protocol):
    """States are `Touched` or `Met`. What the robot meets has a number (`cfem.contact.pairs.numbers_of`)."""

    walks: bool
    """Whether the way between two states is gone in steps."""

    def step(self, delta_a: np.ndarray, before: Any, unilateral: np.ndarray | None = None) -> Any:
        """unilateral (n_a,) bool: actuators of the robot that go slack where they would push, none unless given."""
        ...

    def stands(self, state: Any) -> np.ndarray:
        """(n_a,) mm where the robot's actuators are."""
        ...

    def again(self, here: Any, before: Any) -> Any:
        """The state `here`, whose friction counts from where that of a step to it does: from `before`."""
        ...

    def carried(self, state: Any, courses: Mapping[int, PrescribedMotion], begin: float, end: float) -> Any:
        """What sticks to something that moves goes with it."""
        ...

    def effectors(self, state: Any) -> tuple[np.ndarray, np.ndarray]:
        """(n_e,) mm and (n_a,) N of the robot."""
        ...

    def pressed(self, state: Any, number: int) -> float:
        """N, the sum of the normal forces; where nothing is, minus the smallest gap, in mm."""
        ...


@dataclass(frozen=True)
class RigidSteps:
    touchable: Touchable
    obstacles: ObstacleSet
    mu: float

    @property
    def walks(self) -> bool:
        return self.mu > 0

    def step(self, delta_a: np.ndarray, before: Touched | None, unilateral: np.ndarray | None = None) -> Touched:
        return touch_step(self.touchable, delta_a, self.obstacles, mu=self.mu, before=before, unilateral=unilateral)

    def stands(self, state: Touched) -> np.ndarray:
        return state.delta_a

    def again(self, here: Touched, before: Touched) -> Touched:
        return replace(here, stuck=before.stuck, everywhere=before.everywhere)

    def carried(self, state: Touched, courses: Mapping[int, PrescribedMotion], begin: float, end: float) -> Touched:
        if not self.mu:
            return state
        stuck = state.stuck.copy()
        for number, course in courses.items():
            mine = state.patches[(state.obstacles == number - 1) & state.forces.any(axis=1)]
            if len(mine):
                stuck[mine] = course.carried(stuck[mine], begin, end)
        return replace(state, stuck=stuck)

    def effectors(self, state: Touched) -> tuple[np.ndarray, np.ndarray]:
        return state.delta_e, state.lambda_a

    def pressed(self, state: Touched, number: int) -> float:
        found = state.pressed(len(self.obstacles.obstacles))[number - 1]
        if found:
            return float(found)
        gaps = self.obstacles.obstacles[number - 1].distance(state.everywhere)
        return -float(max(gaps[~self.touchable.held_still].min(), 0.0))


@dataclass(frozen=True)
class SoftSteps:
    """The robot is the first of the meeting, the others are at deltas."""

    meeting: Meeting
    deltas: Sequence[np.ndarray]
    walks = True

    def step(self, delta_a: np.ndarray, before: Met | None, unilateral: np.ndarray | None = None) -> Met:
        deltas = [delta_a, *self.deltas]
        return self.meeting.start(deltas) if before is None else self.meeting.step(deltas, before, unilateral)

    def stands(self, state: Met) -> np.ndarray:
        return state.deltas[0]

    def again(self, here: Met, before: Met) -> Met:
        return replace(here, memory=before.memory, places=before.places)

    def carried(self, state: Met, courses: Mapping[int, PrescribedMotion], begin: float, end: float) -> Met:
        return replace(state, memory=state.memory.carried(state.pairs, courses, begin, end))

    def effectors(self, state: Met) -> tuple[np.ndarray, np.ndarray]:
        return state.delta_e[0], state.lambda_a[0]

    def pressed(self, state: Met, number: int) -> float:
        found = state.between(0, number)
        if found:
            return found
        own, others = self.meeting.own[0], len(self.meeting.own)
        if number >= others:
            gaps = self.meeting.obstacles.obstacles[number - others].distance(state.places[own])
            return -float(max(gaps.min(), 0.0))
        return -self.meeting.separation(state, 0, number)
