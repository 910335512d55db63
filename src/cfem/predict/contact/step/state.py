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
from cfem.predict.contact.forces.load_kernel import Answers
from cfem.predict.contact.surface.surfaces import Surfaces

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
    sticks: (N,) bool, patches that friction of an obstacle holds
    given: displacements of the actuators, mm, and then wrenches on the effectors of all robots, robot after robot
    answers: of the robots; pull is negative where a cable that is held would have to push
    error: estimate of how far what forces do is off, a share of it, the largest of all robots and rounds
    deep: whether a patch began so far within an obstacle that, twice as far in, another side of it is nearer: in this
        step, or in one before, since when some patch has been near an obstacle
    unsettled: whether a step that ends in a state on rigid obstacles alone took more than SETTLED rounds, or twice as
        many between nodes: this one, or one before, since when some patch has been near an obstacle
    depth: mm, how far within an obstacle the deepest patch began
    obstacles: where they stand
    met (d,): those that the patches `near` are near
    stored: N mm, by which forces on the patches have changed the energy of all robots
    R (r, 3, 3), t (r, 3) mm: from the frame of each robot to the scene's
    surfaces: of the robots, of these patches
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
    sticks: np.ndarray
    given: np.ndarray
    answers: Answers
    error: float
    deep: bool
    unsettled: bool
    depth: float
    iterations: int
    obstacles: ObstacleSet
    met: np.ndarray
    stored: float
    R: np.ndarray
    t: np.ndarray
    surfaces: Surfaces
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
        models = self.surfaces.predictors
        states = [model.at_displacement(delta) for model, delta in zip(models, self.deltas, strict=True)]
        return not all(model.inside(state) for model, state in zip(models, states, strict=True))

    @property
    def pull(self) -> np.ndarray:
        """(n,) N of the actuators of all robots, robot after robot."""
        return self.answers.pull

    @cached_property
    def deltas(self) -> list[np.ndarray]:
        """(n_a,) mm of each robot's actuators."""
        return self._each(self.given, self.surfaces.actuator_ends)

    @cached_property
    def wrenches(self) -> list[np.ndarray]:
        """(n_e,) on each robot's effectors in its own frame, 0 without."""
        return self._each(self.given[len(self.pull) :], self.surfaces.effector_ends)

    @cached_property
    def delta_e(self) -> list[np.ndarray]:
        """(n_e,) mm of each robot's effectors in its own frame."""
        return self._each(self.answers.displaced, self.surfaces.effector_ends)

    @cached_property
    def lambda_a(self) -> list[np.ndarray]:
        """(n_a,) N of each robot's actuators."""
        return self._each(self.pull, self.surfaces.actuator_ends)

    @cached_property
    def rows(self) -> list[np.ndarray]:
        """(k,) mm of each robot's skin, from which `LearnedSkin.surface` draws it, without what is local."""
        return self._each(self.answers.rows, self.surfaces.mode_ends)

    def _each(self, values: np.ndarray, ends: list[tuple[int, int]]) -> list[np.ndarray]:
        return [values[a:b] for a, b in ends]

    @property
    def on_obstacles(self) -> np.ndarray:
        """(p,) bool: the pairs of patches, not of what is between nodes, that are with obstacles."""
        return self.pairs.at_nodes

    @property
    def steady(self) -> bool:
        """True where all that touches sticks, and no force has changed by more than a share in this step. Where patches
        slide, begin to touch or come off, several states may obey the law: the guess would choose between them."""
        return _steady(self.change, self.forces, self.pairs.slots, self.sticks)

    def going_on(self) -> np.ndarray:
        """Forces (N, 3) N on the patches after a step that goes on as the last one: a guess."""
        return self.forces + self.change

    def slipping_from(self, before: "ContactState") -> "ContactState":
        """This state, whose slip counts from where that of a step from `before` to it does."""
        return replace(self, memory=before.memory, stuck=before.stuck, places=before.places, began=before)

    def with_first_obstacles(self, count: int) -> "ContactState":
        """This state as far as the first `count` obstacles press; the others are gone."""
        if len(self.obstacles.t) <= count:
            return self
        left, gone = self.met < count, self.pairs.partners >= count + len(self.t)
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
def _steady(change, forces, slots, sticks):
    """True where no force (N, 3) N has changed by more than a share GOES_ON of it, and all patches of pairs with
    obstacles stick."""
    for slot in slots:
        if not sticks[slot - len(sticks)]:
            return False
    for p in range(len(forces)):
        by, size = 0.0, 0.0
        for a in range(3):
            by += change[p, a] ** 2
            size += forces[p, a] ** 2
        if not by <= GOES_ON**2 * size:
            return False
    return True
