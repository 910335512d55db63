"""Rounds of one contact step of learned robots (`cfem.predict.contact.scene`): the law of contact, linear about where
the patches are; where its forces bring them; whether the law holds there.

Two kinds of contact enter the law together: patches that may touch an obstacle, and pairs of soft surfaces. An obstacle
is where it is, so that a state is checked against the law in place. The faces of a soft surface are found again in each
round, so that it has settled once they stay."""

from collections.abc import Sequence

import numpy as np

from cfem.contact.law.modes import Mode
from cfem.contact.pairs import Memory, Pairs
from cfem.contact.patch_forces import Balance, TurningCompliance, balance, gaps_in, lawful, turned
from cfem.contact.step_status import StepStatus
from cfem.predict.contact.bodies import Bodies
from cfem.predict.contact.loaded_robots import LoadedRobots
from cfem.predict.contact.on_obstacles import begins_deep, held_by_friction, pairs_with_obstacles
from cfem.predict.contact.poses import Poses
from cfem.predict.contact.soft_pairs import SoftPairs
from cfem.predict.contact.state import ContactState

ITERATIONS = 60
TOLERANCE = 1e-9  # of the length: how far gaps, and places by their forces, may be from what the law says
MOST_PAIRS = 60  # pairs of soft surfaces that may touch at once
OVERLAP = 1e-6  # of the length: how far a patch may be within an obstacle
FAR = 0.1  # of the length: no distance is larger, as none is asked
NEAR = 0.005  # of the length: farther patches on which no obstacle presses are forgotten between steps
NOTHING = np.zeros(0, dtype=np.int64)


class Rounds:
    """State of N patches in the scene during one step.

    places: (N, 3) mm
    near: (d,) patches that may touch an obstacle
    push: (N, 3) N, force of obstacles on the patches
    distance: (N,) mm from obstacles, or less where that is far above 0
    which: (N,) nearest obstacle
    stuck: (N, 3) mm, from where slip along obstacles counts
    soft: pairs of soft surfaces, None where none may touch
    modes: of the patches near obstacles, then of the soft pairs that touch"""

    def __init__(self, scene: Bodies, deltas: Sequence[np.ndarray], before: ContactState | None):
        """Begins at the actuators `deltas` with the contacts of the state `before`, None: without any."""
        self.scene, self.iterations, count = scene, 0, len(scene.bodies)
        self.near, self.push = NOTHING, np.zeros((count, 3))
        self.modes: tuple[Mode, ...] = ()
        self._sticks = np.zeros(count, dtype=bool)  # on obstacles, in the last round
        self._frames: np.ndarray | None = None  # of obstacles at the places, where they are known
        if before is None:
            self.robots = LoadedRobots(scene, deltas, NOTHING, self.push)
        else:
            self.robots = LoadedRobots(scene, deltas, before.known, before.forces)
            self._take_up(before)
        self.poses, self.which = Poses(scene, self.robots), np.zeros(count, dtype=np.int64)
        self._stood = None
        if before is not None:
            self._stood, self.which[before.near] = before.obstacles, before.met
        self._place()
        self.stuck = self.places  # what did not touch slides from where it was
        if before is not None and scene.mu:
            self.stuck = np.where(np.isnan(before.stuck), before.places, before.stuck)
        self._look_at_all()
        self.depth = max(0.0, -float(self.distance.min(initial=0.0)))
        self.deep = begins_deep(self.poses.obstacles, self.places, self.distance, self.which)
        self.deep |= before is not None and before.deep and len(before.near) > 0  # it may still be on the wrong side
        self.soft = SoftPairs(self.robots, before, self.places) if scene.soft else None

    def _take_up(self, before: ContactState) -> None:
        """Takes up the forces of obstacles of the state before."""
        on_obstacles, count = before.on_obstacles, len(before.places)
        patches = before.pairs.points[on_obstacles]
        self.near, self.push[patches] = before.near, before.push[on_obstacles]
        self._sticks[patches] = [before.modes.get(patch + count) is Mode.STICK for patch in patches.tolist()]

    def _place(self) -> None:
        """Puts patches and rigid bodies where the forces bring them."""
        self.places = self.poses.follow(self.near, self.which[self.near], self.push[self.near])

    def _look_at_all(self) -> None:
        """Finds how far all patches are from obstacles."""
        self.distance, self.which = self.poses.obstacles.nearest(self.places, FAR * self.scene.length)
        self.distance[self.scene.held_still] = np.inf

    @property
    def gap(self) -> float:
        """Smallest gap of all, mm."""
        soft = np.inf if self.soft is None else self.soft.pairs.gaps.min(initial=np.inf)
        return float(min(soft, self.distance.min(initial=np.inf)))

    def run(self) -> ContactState:
        """The state in which the rounds end."""
        status = None
        while status is None:
            status = self._round() if self.iterations < ITERATIONS else StepStatus.ITERATIONS
        return self._state(status)

    def _round(self) -> StepStatus | None:
        """Status in which the step ends, None where another round is needed."""
        self.iterations += 1
        near = self.distance <= 0
        if self.soft is None:
            near[self.near] = True  # also those that have opened: only of known patches are places quite known
        else:
            near |= self.push.any(axis=1)
        self.near, self.modes = np.flatnonzero(near), ()
        touching = None if self.soft is None else self.soft.touch(self.places)
        if not len(self.near) and not touching:
            return self._free()
        if len(self.near) > self.scene.most or (touching and len(touching) > MOST_PAIRS):
            self._let_go()
            return StepStatus.MANY
        if not self._know(touching):
            return None
        answer = self._law()
        if answer is None:
            return StepStatus.NO_MODE
        return StepStatus.CONVERGED if self._move(*answer) else None

    def _free(self) -> StepStatus | None:
        """Status of a round in which nothing touches."""
        free = not self.robots.forces.any()
        self._let_go()
        if self.soft is None:
            return StepStatus.CONVERGED
        self._place()
        if self.scene.rigid is not None:
            self._look_at_all()
        self.soft.detect(self.places)
        return StepStatus.CONVERGED if free and self.soft.apart(self.places) else None

    def _let_go(self) -> None:
        """Takes all forces off."""
        self.near, self.push = NOTHING, np.zeros_like(self.push)
        self.robots.know(NOTHING if self.soft is None else self.robots.known, self.push)
        if self.soft is not None:
            self.soft.push = {}

    def _know(self, touching: Pairs | None) -> bool:
        """Makes all patches known that may touch. False where more touch then."""
        near, before = self.near, self.robots.known
        known = near if touching is None else np.union1d(np.union1d(before, touching.used), near)
        if len(known) > len(before):
            self.robots.know(known, self.robots.forces)
            self._place()  # moved by those beside them
            self._frames = None
            self.distance[near], self.which[near] = self.poses.obstacles.nearest(self.places[near])
            if self.soft is not None:
                self.soft.onwards(self.places)
                touching = self.soft.touch(self.places)
                if not np.isin(touching.used, known).all():
                    return False
        if self.soft is not None:
            self.soft.take(touching, self.places)
        return True

    def _law(self) -> tuple[Balance, np.ndarray | None] | None:
        """Forces that obey the law, linear about the places, and the change (3 c, 3 c) of forces as they turn with the
        places of patches, None where they do not turn. None where nothing obeys the law."""
        frames, mu = self._frames_of_near(), self.scene.mu
        compliance = self.robots.compliance(under_forces=True)
        turning = self._turned(compliance, frames)
        gaps, push, relative = self._gaps(frames), self.push[self.near], None
        if self.soft is not None:
            touching = self.soft.touching
            alone = np.zeros((len(self.near), len(self.robots.known)))
            alone[np.arange(len(self.near)), self._of_near()] = 1.0
            relative = np.concatenate([alone, touching.relative[:, self.robots.known]])
            gaps = np.concatenate([gaps, self.soft.gaps(self.places, mu)])
            frames = np.concatenate([frames, touching.frames])
            push = np.concatenate([push, self.soft.push_of(touching)])
        self._mobility = self.poses.mobility(
            self.places, self.near, self.which[self.near], None if relative is None else relative[len(self.near) :]
        )
        given = gaps, self.robots.on_known, push, mu, self._mobility
        if turning is not None:
            answer = balance(relative, frames, turning.compliance, *given)
            if answer is not None:
                return answer, turning.turning
        answer = balance(relative, frames, compliance, *given)
        if answer is None:  # under large forces the derivative may be indefinite, which this is not
            answer = balance(relative, frames, self.robots.compliance(under_forces=False), *given)
        return None if answer is None else (answer, None)

    def _turned(self, compliance: np.ndarray, frames: np.ndarray) -> TurningCompliance | None:
        """Compliance with forces that turn by the curvature of obstacles, None without curvature; frames (d, 3, 3)."""
        if not self.poses.obstacles.curved or not len(self.near):
            return None
        pressing = np.where(self._sticks[self.near], 0.0, (frames[:, 0] * self.push[self.near]).sum(axis=1))
        if not pressing.any():
            return None
        bends = self.poses.obstacles.bends(self.which[self.near], self.places[self.near])
        return turned(compliance, self._on_known(pressing[:, None, None] * bends))

    def _gaps(self, frames: np.ndarray) -> np.ndarray:
        """(d, 3) mm of patches near obstacles, in their `frames` (d, 3, 3): from these, and from where they last
        stuck."""
        near = self.near
        stuck = self._stuck_now(near) if self.scene.mu else self.stuck[near]
        return gaps_in(frames, self.places[near], stuck, self.distance[near], float(self.scene.mu))

    def _move(self, answer: Balance, turning: np.ndarray | None) -> bool:
        """Loads the forces of the answer, which move the patches. True where the law holds there too."""
        d, forces, self.modes = len(self.near), answer.forces, answer.modes
        local, push = answer.local[:d], answer.push[:d]
        if turning is not None:
            change = (turning @ answer.change.ravel()).reshape(-1, 3)
            push, forces = push + change[self._of_near()], forces + change
        self._sticks[:] = False
        self._sticks[self.near] = [mode is Mode.STICK for mode in answer.modes[:d]]
        self._press(push, forces)
        before = self.places
        self._place()
        if self.soft is not None:
            self.soft.press(answer.push[d:], float(np.abs(answer.step).max()))
        self._look(before)
        settled = self.soft is None or self.soft.settled(self.places, self.near)
        by_law = self._lawful(local, push) if d else push
        if by_law is None or not settled:
            return False
        if not np.array_equal(by_law, push):
            self._press(by_law, forces + self._on_known(by_law - push))
        return True

    def _lawful(self, local: np.ndarray, push: np.ndarray) -> np.ndarray | None:
        """(d, 3) N: what obstacles press by the frames at the places, None where the law does not hold there with
        this; local (d, 3) N in the frames before, push (d, 3) N in the scene."""
        scene, self._frames = self.scene, None
        frames, compliance = self._frames_of_near(), self.robots.compliance(under_forces=False)
        by_bodies = np.zeros((0, 0)) if self._mobility is None else self._mobility[: local.size, : local.size]
        there = frames, self._gaps(frames), compliance, np.searchsorted(self.robots.known, self.near)
        by_law, missed, beyond = lawful(local, push, self._sticks[self.near], *there, by_bodies, float(scene.mu))
        if missed > TOLERANCE * scene.length or self.distance.min() < -OVERLAP * scene.length:
            return None
        return None if beyond > TOLERANCE * np.abs(push).max() else by_law

    def _press(self, push: np.ndarray, forces: np.ndarray) -> None:
        """Puts push (d, 3) N of obstacles, of all forces (c, 3) N on the known patches, and takes all others off."""
        self.robots.load(forces)
        self.push = self.robots.forces
        if self.soft is not None:
            self.push = np.zeros_like(self.push)
            self.push[self.near] = push

    def _of_near(self) -> np.ndarray | slice:
        """Positions of `near` among the known patches: these are the same without soft pairs."""
        return slice(None) if self.soft is None else np.searchsorted(self.robots.known, self.near)

    def _on_known(self, values: np.ndarray) -> np.ndarray:
        """Values (c, ...) of known patches: those of the patches near obstacles (d, ...), 0 of the others."""
        if self.soft is None:
            return values
        result = np.zeros((len(self.robots.known), *values.shape[1:]))
        result[self._of_near()] = values
        return result

    def _look(self, before: np.ndarray) -> None:
        """Updates distances and soft pairs after patches have moved from places `before` (N, 3) mm. Those that cannot
        have come near an obstacle keep the distance that is certain."""
        if self.scene.rigid is not None:
            self._look_at_all()
        else:
            self.distance = self.distance - 2 * np.abs(self.places - before).max()  # more than the root of 3
            near = self.distance <= 0
            near[self.near] = True
            self.distance[near], self.which[near] = self.poses.obstacles.nearest(self.places[near])
        if self.soft is not None:
            self.soft.detect(self.places)

    def _frames_of_near(self) -> np.ndarray:
        """Frames (d, 3, 3) of the obstacles at patches near them."""
        if self._frames is None or len(self._frames) != len(self.near):
            self._frames = self.poses.obstacles.frames(self.which[self.near], self.places[self.near])
        return self._frames

    def _state(self, status: StepStatus) -> ContactState:
        """The state in which the step ends: pairs, forces and memory, with patches known to the next step."""
        near, soft, loaded = self.near, self.soft, self.robots.loaded
        touches = self.push[near].any(axis=1) | (self.distance[near] <= 0)
        next_near = known = near[touches | (self.distance[near] < NEAR * self.scene.length)]
        pairs, push, memory = self._pairs(touches), self.push[near[touches]], Memory()
        modes = zip((near + len(self.places)).tolist(), self.modes, touches.tolist(), strict=False)
        modes = {slot: mode for slot, mode, does in modes if does}
        if soft is not None:
            modes |= dict(zip(soft.touching.slots.tolist(), self.modes[len(near) :], strict=False))
            memory, pairs = soft.memory_after(self.places, modes), soft.pairs.joined(pairs)
            push = np.concatenate([soft.push_of(soft.pairs), push])
            known = soft.to_be_known(self.places, self.poses.obstacles)
        delta_e, lambda_a, relief, moved = self.robots.outputs()
        return ContactState(
            pairs,
            push,
            self.scene.bodies,
            status,
            self.robots.forces,
            self.places,
            known,
            next_near,
            modes,
            self._stuck_next(),
            memory,
            [robot.delta for robot in loaded],
            delta_e,
            lambda_a,
            relief,
            [
                np.zeros_like(e) if robot.wrench is None else robot.wrench
                for robot, e in zip(loaded, moved, strict=True)
            ],
            moved,
            [robot.rows for robot in loaded],
            max(robot.error for robot in loaded),
            self.deep,
            self.depth,
            self.iterations,
            self.poses.obstacles,
            self.which[next_near],
            sum(robot.stored() for robot in loaded),
            list(zip(self.robots.R, self.robots.t, strict=True)),
        )

    def _pairs(self, touches: np.ndarray) -> Pairs:
        """Pairs of the patches near obstacles that touch, (d,) bool."""
        patches, frames = self.near[touches], self._frames_of_near()[touches]
        partners = self.which[patches] + len(self.scene.robots)
        return pairs_with_obstacles(patches, frames, self.distance[patches], partners, len(self.places))

    def _stuck_next(self) -> np.ndarray:
        """(N, 3) mm: `ContactState.stuck`."""
        if not self.scene.mu or not self.modes or not len(self.near):
            return np.full_like(self.places, np.nan)
        pressed, sticks = self.near[self.push[self.near].any(axis=1)], self._sticks[self.near]
        stuck, held = self.stuck.copy(), self.near[sticks]
        stuck[held] = self._stuck_now(held)
        return held_by_friction(self.places, stuck, pressed, held, self._frames[sticks, 0])

    def _stuck_now(self, patches: np.ndarray) -> np.ndarray:
        """(d, 3) mm from where the slip of patches (d,) counts, on obstacles that have moved."""
        return self.poses.carried(self.stuck[patches], self.which[patches], self._stood)
