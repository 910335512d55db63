"""Rounds of one contact step of learned robots (`cfem.predict.contact.step.scene`): the law of contact, linear about
where the patches are; where its forces bring them; whether the law holds there.

Two kinds of contact enter the law together: patches that may touch an obstacle, and pairs of soft surfaces or of an
obstacle and the surface between its nodes. An obstacle is where it is, so that a state is checked against the law in
place. What is between nodes, and the faces of a soft surface, are found again in each round, so that it has settled
once they stay. Without any of these pairs near, a step does not ask for them."""

from collections.abc import Iterator, Sequence

import numpy as np

from cfem.contact.acceleration import Acceleration
from cfem.contact.law.modes import Mode
from cfem.contact.law.newton import of_numbers
from cfem.contact.law.sliding import StepBegin
from cfem.contact.pairs import Memory, Pairs
from cfem.contact.patch_forces import Balance, TurningCompliance, balance
from cfem.contact.step_status import StepStatus
from cfem.predict.contact.forces.loaded_robots import NOTHING, LoadedRobots
from cfem.predict.contact.step.at_once import HOLDS, IN_PARTS, UnpressedScene, rounds_at_once
from cfem.predict.contact.step.bodies import Bodies
from cfem.predict.contact.step.on_obstacles import BEHIND, SIDE, OnObstacles
from cfem.predict.contact.step.poses import Loads, Poses
from cfem.predict.contact.step.soft_pairs import SoftPairs
from cfem.predict.contact.step.state import SETTLED, ContactState

ITERATIONS = 60
PATIENCE, LEAST = 8, 1 / 64  # rounds that take all of the change of the forces, and the least share of later ones
ACCELERATED = 16  # rounds that combine answers: where a surface loses its hold, no combination of them leads on
ALIKE = 0.5  # cosine between steps that go the same way
PAIRS = 2  # of the points that may touch obstacles at once: pairs of soft surfaces that may touch


class Rounds:
    """State of N patches in the scene during one step.

    places: (N, 3) mm
    met: patches that may touch obstacles
    soft: pairs of soft surfaces, and of obstacles between nodes, None where none may touch
    modes: of the patches near obstacles, then of the soft pairs that touch"""

    def __init__(self, scene: Bodies, deltas: Sequence[np.ndarray], before: ContactState | None):
        """Begins at the actuators `deltas` with the contacts of the state `before`, None: without any."""
        self.scene, self.iterations, self.modes = scene, 0, ()
        self._share, self._missed, self._last_step = 1.0, np.inf, np.zeros((0, 3))
        self._acceleration, self._end = Acceleration(), None
        known, forces = NOTHING, np.zeros((len(scene.bodies), 3))
        self._begin = forces if before is None else before.forces
        if before is not None:
            before = before.with_first_obstacles(len(scene.obstacles.t))
            expected = scene.even and not scene.soft and before.steady
            known, forces = before.known, before.going_on() if expected else before.forces
        self.robots = LoadedRobots(scene.surfaces, deltas, scene.wrenches, scene.R, scene.t, known, forces)
        self.poses = Poses(scene, self.robots)
        self.met = OnObstacles(self.poses, before, forces)
        stays = before is not None and len(before.near) > 0  # on the wrong side, or branch, where it was before
        self.depth, self.deep, self._unsettled = 0.0, stays and before.deep, stays and before.unsettled
        more_known = before is not None and len(before.known) > len(before.near)  # than what may touch at nodes
        self._predicted = None if before is None or more_known else UnpressedScene.of(scene)
        if self._predicted is None:
            self._place(before)
        else:
            self._slips = before.stuck, before.places, before.obstacles.R, before.obstacles.t
        follows = scene.mu > 0 and scene.parts > 1 and scene.rigid is None
        self._origin = (before.began or before) if before is not None and follows else None
        self.soft = None
        if scene.soft or more_known or self._between_nodes():
            self._look_between_nodes(before)

    def _place(self, before: ContactState | None) -> None:
        """Puts all where the forces bring it, and finds how far patches are from obstacles."""
        met = self.met
        self.places = met.stuck = met.place()  # what did not touch slides from where it was
        if before is not None and self.scene.mu:
            met.stuck = np.where(np.isnan(before.stuck), before.places, before.stuck)
        met.held = met.stuck
        met.look_at_all(self.places)
        self.depth = max(0.0, -float(met.distance.min(initial=0.0)))
        self.deep |= self.depth > 0 and self.poses.obstacles.deep(met.which, self.places, met.distance, SIDE)

    def _at_once(self, first: bool) -> StepStatus | None:
        """Status in which rounds in one call end, None where more are needed; first: whether they are the first."""
        robots, met, poses = self.robots, self.met, self.poses
        to_answer = robots.surfaces.actuators, robots.numbers
        how, rounds, placed, depth, deep, met.held, push, met.sticks, modes, met.missed, *self._end = rounds_at_once(
            *(robots.arrays, to_answer, robots.room, self._predicted, robots.R, robots.t),
            *((met.near, met.which, robots.forces, met.sticks), self._slips, float(self.scene.mu)),
            *(self.scene.length, PATIENCE - self.iterations, first),
        )
        self.places, robots.R, robots.t, R, t, met.distance, met.which = placed
        poses.obstacles = poses.obstacles.posed(R, t)
        robots.have(push, how == IN_PARTS)
        met.forget_frames()
        met.stuck, met.push, self.modes, self._missed = met.held, push, of_numbers(modes), met.missed
        self.iterations += rounds
        if first:
            self.depth, self.deep = depth, self.deep or deep
        return StepStatus.CONVERGED if how == HOLDS else None

    def _look_between_nodes(self, before: ContactState | None) -> None:
        """Takes pairs of soft surfaces, and of obstacles between nodes, into the law from now on."""
        self.soft = SoftPairs(self.robots, self.scene, self.poses.obstacles, before, self.places)

    def _between_nodes(self) -> bool:
        """True where an obstacle reaches into a surface between its nodes."""
        scene, obstacles = self.scene, self.poses.obstacles
        if not scene.meets_between_nodes or not len(obstacles.t):
            return False
        return bool((scene.surroundings.between_nodes(self.places, obstacles).gaps < 0).any())

    @property
    def gap(self) -> float:
        """Smallest gap of all, mm."""
        soft = np.inf if self.soft is None else self.soft.pairs.gaps.min(initial=np.inf)
        return float(min(soft, self.met.distance.min(initial=np.inf)))

    def run(self) -> ContactState:
        """The state in which the rounds end."""
        status = None if self._predicted is None else self._at_once(True)
        while status is None:
            status = self._round() if self.iterations < ITERATIONS else StepStatus.ITERATIONS
            if status is StepStatus.CONVERGED and self.soft is None and self._between_nodes():
                status = self._look_between_nodes(None)
        return self._state(status)

    def _round(self) -> StepStatus | None:
        """Status in which the step ends, None where another round is needed."""
        self.iterations, self._end = self.iterations + 1, None
        near = self.met.distance <= 0
        if self.soft is None:
            near[self.met.near] = True  # also those that have opened: only of known patches are places quite known
        else:
            near |= self.met.push.any(axis=1)
        self.met.take(np.flatnonzero(near))
        self.modes = ()
        touching = None if self.soft is None else self.soft.touch(self.places)
        if not len(self.met.near) and not touching:
            return self._free()
        most = self.scene.surfaces.most
        if len(self.met.near) > most or (touching and len(touching) > PAIRS * most):
            self._let_go()
            return StepStatus.MANY
        grows = len(self.met.near) > len(self.robots.known)
        if not self._know(touching):
            return None
        if grows and self._predicted is not None and self.iterations <= PATIENCE:
            self.iterations -= 1
            return self._at_once(False)
        answer = self._law()
        if answer is None:
            return StepStatus.NO_MODE
        lawful, turning = answer
        step = self._last_step if self.soft is None else lawful.step  # only faces of soft surfaces need it
        largest = float(np.abs(step).max()) if step.size else 0.0
        taken = self._taken(lawful, largest)
        holds = self._move(taken, turning, largest)
        self._weigh(step, largest)
        return StepStatus.CONVERGED if holds and taken is lawful else None

    @property
    def _on_faces(self) -> bool:
        """True where pairs of soft surfaces touch."""
        return self.soft is not None and len(self.soft.touching) > 0

    def _taken(self, answer: Balance, largest: float) -> Balance:
        """Forces that the round takes: the answer of the law, a share of its change, or, where faces of soft surfaces
        turn from round to round, the answers of the last rounds combined. largest: mm, by which patches move at most
        with all of the answer."""
        soft, share, mu = self.soft, self._share, self.scene.mu
        if share < 1:
            push, forces = self._pushes(), self.robots.on_known
            push, forces = push + share * (answer.push - push), forces + share * (answer.forces - forces)
            self._acceleration.forget()
            return answer.with_forces(push, forces, self._frames(), mu)
        if not self._on_faces or soft.at_rest(largest) or self.iterations > ACCELERATED:
            return answer
        rows = self.met.near.tobytes(), soft.touching.slots.tobytes(), self.robots.known.tobytes(), answer.modes
        combined = self._acceleration.next(rows, np.concatenate([answer.push, answer.forces]), answer.step)
        if combined is None:
            return answer
        pairs = len(answer.push)
        return answer.with_forces(combined[:pairs], combined[pairs:], self._frames(), mu)

    def _weigh(self, step: np.ndarray, largest: float) -> None:
        """Share of the change of the forces that the next round takes: half of this one's where patches miss the law by
        more than in the last round, else twice as much. Where a body softens, or a patch is about to slide, whole
        changes may lead from one round to the next and back. A patch that slides off its faces misses the law by more
        and more, so that there a step in the same direction as the last also doubles the share.

        step: (c, 3) mm, by which all of the change moves patches
        largest: mm, of `step`"""
        last, self._missed = self._missed, self.met.missed if len(self.met.near) else 0.0
        onwards = False
        if self._on_faces:
            self._missed = max(self._missed, largest)
            onwards = same_way(step, self._last_step)
        self._last_step = step
        if self.iterations > PATIENCE:
            self._share = min(2 * self._share, 1.0) if self._missed < last or onwards else max(self._share / 2, LEAST)

    def _free(self) -> StepStatus | None:
        """Status of a round in which nothing touches."""
        free = not self.robots.forces.any()
        self._let_go()
        if self.soft is None:
            return StepStatus.CONVERGED
        self.places = self.met.place()
        if self.scene.rigid is not None:
            self.met.look_at_all(self.places)
        self.soft.detect(self.places)
        return StepStatus.CONVERGED if free and self.soft.apart(self.places) else None

    def _let_go(self) -> None:
        """Takes all forces off."""
        self.met.let_go()
        known = NOTHING if self.soft is None else self.robots.known
        if len(known) < len(self.robots.known) or self.robots.forces.any():
            self.robots.know(known, self.met.push)
        if self.soft is not None:
            self.soft.push = {}

    def _know(self, touching: Pairs | None) -> bool:
        """Makes all patches known that may touch. False where more touch then."""
        near, before = self.met.near, self.robots.known
        known = near if touching is None else np.union1d(np.union1d(before, touching.used), near)
        if len(known) > len(before):
            self.robots.know(known, self.robots.forces)
            if self._predicted is not None:
                return True
            self.places = self.met.place()  # moved by those beside them
            self.met.look_again(self.places)
            if self.soft is not None:
                self.soft.onwards(self.places)
                touching = self.soft.touch(self.places)
                if not np.isin(touching.used, known).all():
                    return False
        if self.soft is not None:
            self.soft.take(touching, self.places)
        return True

    def _frames(self) -> np.ndarray:
        """(p, 3, 3) frames of the pairs of the law: of obstacles, then of soft surfaces."""
        frames = self.met.frames(self.places)
        return frames if self.soft is None else np.concatenate([frames, self.soft.touching.frames])

    def _pushes(self) -> np.ndarray:
        """(p, 3) N on the pairs of the law, as they are."""
        push = self.met.push[self.met.near]
        return push if self.soft is None else np.concatenate([push, self.soft.push_of(self.soft.touching)])

    def _law(self) -> tuple[Balance, np.ndarray | None] | None:
        """Forces that obey the law, linear about the places, and (3 d, 3 p) how those of obstacles turn with changes of
        all, None where none turns. None where nothing obeys the law."""
        met, places, mu = self.met, self.places, self.scene.mu
        met.stuck = met.held
        frames, near, gaps, relative, push = self._frames(), met.near, met.gaps(places), None, self._pushes()
        if self.soft is not None:
            known, touching = self.robots.known, self.soft.touching
            alone = np.zeros((len(near), len(known)))
            alone[np.arange(len(near)), self._of_near()] = 1.0
            relative = np.concatenate([alone, touching.relative[:, known]])
            gaps = np.concatenate([gaps, self.soft.gaps(places, mu)])
        for compliance, turned, loads in self._linearisations():
            if relative is None and turned is None and self.poses.rigid is not None:
                answer, yields = self.poses.balance(frames, gaps, places, near, met.which, loads, compliance)
                if answer is not None:
                    self._mobility = yields.mobility
                    return answer, yields.turning
            yields = self.poses.yields(places, near, met.which, loads, relative, compliance, turned)
            if yields is None:
                continue
            given = gaps, self.robots.on_known, push, mu, yields.mobility, self._step_begin()
            answer = balance(relative, frames, compliance, *given)
            if answer is not None:
                self._mobility = yields.mobility
                met.slide(answer.slid[: len(near)])
                if self.soft is not None:
                    self.soft.slide(answer.slid[len(near) :])
                return answer, yields.turning
        return None

    def _step_begin(self) -> StepBegin | None:
        """Gaps and forces of the pairs of the law at the begin of the step, None where friction is not followed along
        it."""
        origin, near = self._origin, self.met.near
        if origin is None:
            return None
        gaps, push, pressed = np.zeros((len(near), 3)), np.zeros_like(self.places), origin.on_obstacles
        gaps[:, 0] = origin.obstacles.nearest(origin.places[near])[0]
        push[origin.pairs.points[pressed]] = origin.push[pressed]
        push = push[near]
        if self.soft is not None:
            soft_gaps, soft_push = self.soft.at_begin(origin, self.places)
            gaps, push = np.concatenate([gaps, soft_gaps]), np.concatenate([push, soft_push])
        return StepBegin(gaps, push, self.scene.parts)

    def _linearisations(self) -> Iterator[tuple[np.ndarray, TurningCompliance | None, Loads]]:
        """Compliance of the known patches, with how forces turn, and the forces that bodies turn, as `Poses.yields` has
        them: the derivative, that without curvature, and, as it may be indefinite under large forces, what is not."""
        met, robots = self.met, self.robots
        compliance, loads = robots.compliance(under_forces=True), (robots.on_known, met.push, ~met.sticks[met.near])
        turned = met.turned(compliance, self.places, robots.known)
        if turned is not None:
            yield turned.compliance, turned, loads
        yield compliance, None, loads
        nothing = np.zeros_like(robots.on_known), np.zeros_like(met.push), loads[2]
        yield robots.compliance(under_forces=False), None, nothing

    def _move(self, answer: Balance, turning: np.ndarray | None, step: float) -> bool:
        """Loads the forces of the answer, and by what those of obstacles turn (`turning`, as of `_law`), which move the
        patches. True where the law holds there too. step: mm, by which all of the law's answer moves them."""
        met, d, forces, self.modes = self.met, len(self.met.near), answer.forces, answer.modes
        local, push = answer.local[:d], answer.push[:d]
        if turning is not None:
            turned = (turning @ (answer.push - self._pushes()).ravel()).reshape(-1, 3)
            push, forces = push + turned, forces.copy()
            forces[self._of_near()] += turned
        met.sticks = np.zeros(len(met.sticks), dtype=bool)
        met.sticks[met.near] = [mode is Mode.STICK for mode in answer.modes[:d]]
        self._press(push, forces)
        before, self.places = self.places, met.place()
        if self.soft is not None:
            self.soft.press(answer.push[d:], step)
        met.look(self.places, before)
        if self.soft is not None:
            self.soft.detect(self.places)
        settled = self.soft is None or self.soft.settled(self.places, met.near)
        by_law = push
        if d:
            yields, at = self.robots.compliance(under_forces=False), np.searchsorted(self.robots.known, met.near)
            by_law = met.lawful(local, push, self.places, yields, at, self._mobility)
        if by_law is None or not settled:
            return False
        if by_law is not push:
            change = np.zeros_like(forces)
            change[self._of_near()] = by_law - push
            self._press(by_law, forces + change)
        return True

    def _press(self, push: np.ndarray, forces: np.ndarray) -> None:
        """Puts push (d, 3) N of obstacles, of all forces (c, 3) N on the known patches, and takes all others off."""
        self.robots.load(forces)
        self.met.push = self.robots.forces
        if self.soft is not None:
            self.met.push = np.zeros_like(self.met.push)
            self.met.push[self.met.near] = push

    def _of_near(self) -> np.ndarray | slice:
        """Positions of patches near obstacles among the known ones: these are the same without soft pairs."""
        return slice(None) if self.soft is None else np.searchsorted(self.robots.known, self.met.near)

    def _state(self, status: StepStatus) -> ContactState:
        """The state in which the step ends: pairs, forces and memory, with patches known to the next step."""
        met, near, places, robots, memory = self.met, self.met.near, self.places, self.robots, Memory()
        end, answers = self._end or (met.ended(places, self.modes), robots.answers)
        pairs, push, known = end.pairs, end.push, end.near
        slots = zip(end.slots.tolist(), end.touching.tolist(), strict=True)
        modes = {slot: self.modes[number] for slot, number in slots} if self.modes else {}
        if self.soft is not None:
            soft = self.soft
            modes |= dict(zip(soft.touching.slots.tolist(), self.modes[len(near) :], strict=False))
            memory, pairs = soft.memory_after(places, modes), soft.pairs.joined(pairs)
            push = np.concatenate([soft.push_of(soft.pairs), push])
            known = soft.to_be_known(places, self.poses.obstacles)
        hurried = False
        if self.iterations > SETTLED:
            pressed = pairs.some(push.any(axis=1))
            most = SETTLED if pressed.at_nodes.all() else 2 * SETTLED  # as forces turn with the surface between nodes
            hurried = self.iterations > most and bool((pressed.slots >= len(places)).all())
        return ContactState(
            pairs,
            push,
            self.scene.bodies,
            status,
            robots.forces,
            robots.forces - self._begin,
            places,
            known,
            end.near,
            modes,
            end.stuck,
            memory,
            met.sticks,
            robots.given,
            answers,
            answers.error,
            self.deep or met.behind > BEHIND * self.scene.length,
            self._unsettled or hurried,
            self.depth,
            self.iterations,
            self.poses.obstacles,
            end.met,
            answers.stored,
            robots.R,
            robots.t,
            self.scene.surfaces,
        )


def same_way(step: np.ndarray, last: np.ndarray) -> bool:
    """True where steps of the same patches, (c, 3) mm, go the same way."""
    if step.shape != last.shape:
        return False
    return bool((step * last).sum() > ALIKE * np.sqrt((step**2).sum() * (last**2).sum()))
