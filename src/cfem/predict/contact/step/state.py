"""Answers of the contact of learned robots (`cfem.predict.contact.step.scene`)."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numba import njit

from cfem.contact.law.modes import Mode
from cfem.contact.obstacle_set import ObstacleSet
from cfem.contact.pairs import Memory, Pressing
from cfem.contact.prescribed_motion import PrescribedMotion
from cfem.contact.step_status import StepStatus
from cfem.predict.protocol import Predictor

GOES_ON = 0.3  # of a force: the largest change in a step that is expected to go on
TRUSTED = 0.035  # estimated error of the motion by forces; forces are then within 5 % (docs/contact.md)
# Rounds on rigid obstacles. Where more are needed, the robot is close to an instability between them, and small errors
# of its compliance become large errors of the forces (docs/contact.md).
SETTLED = 6


@dataclass(frozen=True)
class ContactState(Pressing):
    """One state of a scene. Of all N patches, robot after robot, in the scene's axes. `pairs` are those of soft
    surfaces that are near each other, of obstacles near the surface between its nodes, then those of patches that touch
    obstacles.

    forces (N, 3) N, places (N, 3) mm: of all patches
    change: (N, 3) N of the forces in this step
    known (c,): patches whose local motion is known
    near (d,): those of them that touch obstacles, or may touch one next
    modes: by slot, of pairs that touch
    stuck (N, 3) mm: where friction of an obstacle holds each patch, NaN where none does
    memory: from where the slip of soft surfaces, and between nodes, counts
    deltas (n_a,) mm, delta_e (n_e,) mm, lambda_a (n_a,) N of each robot in its own frame; lambda_a is negative where a
        cable that is held would have to push; relief (n_a,) N of it is what the forces on patches take off
    wrenches (n_e,): on its effectors, 0 without; moved (n_e,) mm: what of delta_e the forces on patches make
    rows (k,) mm: of each robot's skin, from which `LearnedSkin.surface` draws it, without what is local
    error: estimate of how far what forces do is off, a share of it, the largest of all robots and rounds
    deep: whether a patch began so far within an obstacle that, twice as far in, another side of it is nearer: in this
        step, or in one before, since when some patch has been near an obstacle
    unsettled: whether a step that ends in a state on rigid obstacles alone took more than SETTLED rounds, or twice as
        many between nodes: this one, or one before, since when some patch has been near an obstacle
    depth: mm, how far within an obstacle the deepest patch began
    obstacles: where they stand
    met (d,): those that the patches `near` are near
    stored: N mm, by which forces on the patches have changed the energy of all robots
    poses: (3, 3) and (3,) mm from the frame of each robot to the scene's
    models: of each robot
    began: the state from which the step to this one went, where steps beside it are asked for (`slipping_from`)"""

    status: StepStatus
    forces: np.ndarray
    change: np.ndarray
    places: np.ndarray
    known: np.ndarray
    near: np.ndarray
    modes: Mapping[int, Mode]
    stuck: np.ndarray
    memory: Memory
    deltas: list[np.ndarray]
    delta_e: list[np.ndarray]
    lambda_a: list[np.ndarray]
    relief: list[np.ndarray]
    wrenches: list[np.ndarray]
    moved: list[np.ndarray]
    rows: list[np.ndarray]
    error: float
    deep: bool
    unsettled: bool
    depth: float
    iterations: int
    obstacles: ObstacleSet
    met: np.ndarray
    stored: float
    poses: list[tuple[np.ndarray, np.ndarray]]
    models: list[Predictor]
    began: "ContactState | None" = None

    @property
    def converged(self) -> bool:
        return self.status is StepStatus.CONVERGED

    @property
    def trusted(self) -> bool:
        """True where the models know the actuators, forces bend the robots no further than is known, to 5 %, no step
        was longer than what it is linear about allows, and the forces settled. Beyond, forces may be wrong, a patch may
        lie on another side than the one on which it came in, and rounding may choose between states that all obey the
        law: take shorter steps. Where an edge comes straight at a patch, or at a node of a robot whose base
        moves, there are two states however short they are."""
        return self.error <= TRUSTED and not self.deep and not self.outside and not self.unsettled

    @cached_property
    def outside(self) -> bool:
        """True where a robot that nothing touches would be beyond what its model was trained on, its actuators as they
        are."""
        states = [model.at_displacement(delta) for model, delta in zip(self.models, self.deltas, strict=True)]
        return not all(model.inside(state) for model, state in zip(self.models, states, strict=True))

    @cached_property
    def pull(self) -> np.ndarray:
        """(n,) N of the actuators of all robots, robot after robot."""
        return np.concatenate(self.lambda_a)

    @cached_property
    def commanded(self) -> tuple[np.ndarray, np.ndarray]:
        """(n,) what is given of all robots, displacements of actuators and then wrenches, and (n,) what the forces on
        patches answer, `relief` and `moved`: their product is work that they take, N mm."""
        return np.concatenate([*self.deltas, *self.wrenches]), np.concatenate([*self.relief, *self.moved])

    @property
    def on_obstacles(self) -> np.ndarray:
        """(p,) bool: the pairs of patches, not of what is between nodes, that are with obstacles."""
        return self.pairs.at_nodes

    @property
    def steady(self) -> bool:
        """True where all that touches sticks, and no force has changed by more than a share in this step. Where patches
        slide, begin to touch or come off, several states may obey the law: the guess would choose between them."""
        return all(mode is Mode.STICK for mode in self.modes.values()) and _changes_little(self.change, self.forces)

    def going_on(self) -> tuple[np.ndarray, np.ndarray]:
        """Forces (N, 3) N on the patches, and push (p, 3) N on the pairs, after a step that goes on as the last one: a
        guess. All pairs are with obstacles."""
        return self.forces + self.change, self.push + self.change[self.pairs.points]

    def slipping_from(self, before: "ContactState") -> "ContactState":
        """This state, whose slip counts from where that of a step from `before` to it does."""
        return replace(self, memory=before.memory, stuck=before.stuck, places=before.places, began=before)

    def with_first_obstacles(self, count: int) -> "ContactState":
        """This state as far as the first `count` obstacles press; the others are gone."""
        left, gone = self.met < count, self.pairs.partners >= count + len(self.poses)
        if left.all() and not gone.any():
            return self
        near = self.near[left]
        forces = self.forces - self.pairs.relative[gone].T @ self.push[gone]
        known = near if self.on_obstacles.all() else self.known
        pairs, push = self.pairs.some(~gone), self.push[~gone]
        return replace(self, pairs=pairs, push=push, forces=forces, known=known, near=near, met=self.met[left])

    def carried(self, courses: Mapping[int, PrescribedMotion], begin: float, end: float) -> "ContactState":
        """This state, whose patches go with the obstacles that hold them: courses of obstacles, by their number among
        the partners of `pairs`, from share `begin` to `end` of the run."""
        stuck, pressed = self.stuck.copy(), self.push.any(axis=1) & self.on_obstacles
        for number, course in courses.items():
            patches = self.pairs.points[(self.pairs.partners == number) & pressed]
            patches = patches[np.isfinite(stuck[patches, 0])]
            if len(patches):
                stuck[patches] = course.carried(stuck[patches], begin, end)
        return replace(self, stuck=stuck, memory=self.memory.carried(self.pairs, courses, begin, end))


@njit(cache=True, error_model="numpy")
def _changes_little(change, forces):
    """True where no force (N, 3) N has changed by more than a share GOES_ON of it."""
    for p in range(len(forces)):
        by, size = 0.0, 0.0
        for a in range(3):
            by += change[p, a] ** 2
            size += forces[p, a] ** 2
        if not by <= GOES_ON**2 * size:
            return False
    return True
