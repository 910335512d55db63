"""Robots by finite elements that touch each other, themselves and rigid obstacles, with friction: the reference of
`cfem.predict.contact.step.scene`.

Newton's method on all robots and all forces together: at each iteration the law on pairs of a patch and what is before
it (`cfem.contact.pairs`) is solved on how the robots' linearisations go (`cfem.equilibrium.contact.pressed_robot`), and
gives the forces of the step. Patches that come near take part. At the end each robot is solved alone with its patches
held where they are, and has to carry the same forces."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.linalg import block_diag

from cfem.condensed.patches import Patches
from cfem.contact.acceleration import Acceleration
from cfem.contact.law.modes import Mode
from cfem.contact.law.problem import demand_friction
from cfem.contact.law.sliding import FOLLOWED, StepBegin
from cfem.contact.obstacle_set import ObstacleSet
from cfem.contact.pairs import Memory, Pairs, Pressing, Surroundings
from cfem.contact.patch_forces import balance
from cfem.contact.step_status import StepStatus
from cfem.equilibrium.contact.pressed_robot import STRICT, PressedRobot
from cfem.equilibrium.contact.skinned_robot import SkinnedRobot
from cfem.equilibrium.quasi_static import all_carried_out
from cfem.equilibrium.solve import Wanted, solve
from cfem.equilibrium.system.actuation import displacement
from cfem.equilibrium.system.evaluation import SolveCost
from cfem.equilibrium.system.solution import Equilibrium
from cfem.mechanics.factorization import SingularMatrixError

NEAR = 0.4  # distances of patches: of pairs whose gap is less the patches are contact points
MOST = 1500  # contact points of a robot
SHARE = 0.05  # of its reach: the longest way of an actuator in one step
SHORT = 1 / 8  # of that way: in so short a step one patch may begin to press while another lets go
FALLS = 0.2  # of the last correction: slower rounds combine their answers
TOLERANCE, ITERATIONS = 1e-8, 80  # of the length: the last step of any contact point; corrections
SAME = 1e-6  # of the largest force: by how much any may change in the last step, or be another where patches are held


@dataclass(frozen=True)
class SurfacesState(Pressing):
    """One state of the scene.

    solved: of each robot
    points: (c,) the contact points, of all N patches, robot after robot
    forces: (c, 3) N on these, in the scene
    residual: mm, the last step of any contact point
    iterations: corrections
    factorizations: of all robots"""

    status: StepStatus
    solved: tuple[Equilibrium, ...]
    points: np.ndarray
    forces: np.ndarray
    modes: Mapping[int, Mode]
    memory: Memory
    residual: float
    iterations: int
    factorizations: int

    @property
    def converged(self) -> bool:
        return self.status is StepStatus.CONVERGED


@dataclass(frozen=True, eq=False)
class SurfaceScene:
    """Robots, the obstacles that all of them meet, and one coefficient of friction.

    parts: in which friction is followed along a step (`cfem.contact.law.sliding`)"""

    robots: Sequence[SkinnedRobot]
    obstacles: ObstacleSet = field(default_factory=lambda: ObstacleSet(()))
    mu: float = 0.0
    parts: int = 1

    def __post_init__(self) -> None:
        demand_friction(self.mu)

    @property
    def length(self) -> float:
        return self.robots[0].robot.length

    @cached_property
    def ends(self) -> list[tuple[int, int]]:
        """First and last patch of each robot among all, the last excluded."""
        return list(pairwise(np.cumsum([0, *(len(robot.patches) for robot in self.robots)]).tolist()))

    @cached_property
    def surroundings(self) -> Surroundings:
        return Surroundings.of(self.robots, [robot.itself for robot in self.robots], self.length)

    def go(self, deltas: Sequence[np.ndarray], before: SurfacesState | None = None) -> SurfacesState:
        """Goes to deltas, (n_a,) mm each, from the state `before` (none: actuators at 0), in steps, which are halved
        where one fails. Never raises for numerical failure: the state where it ended says why."""
        ends = [np.asarray(delta, float) for delta in deltas]
        if before is None:
            begins = [0.0 * end for end in ends]
            before = self.step(begins, None)
        else:  # a slack cable is where no target above it has been
            each = zip(before.solved, ends, strict=True)
            begins = [np.where(solved.slack, np.minimum(solved.delta_a, end), solved.delta_a) for solved, end in each]
        return all_carried_out(begins, ends, self.longest, before, self.short_step)

    @cached_property
    def longest(self) -> list[np.ndarray]:
        """Longest ways (n_a,) mm of the actuators of each robot in one step."""
        return [SHARE * np.abs(robot.robot.reach).max(axis=1) for robot in self.robots]

    def short_step(self, deltas: Sequence[np.ndarray], before: SurfacesState | None) -> SurfacesState:
        """`step`, which is to be halved where one patch begins to press while another lets go: the slip of the new one
        counts from where it has touched, on a way that turns where the other one lets go."""
        state = self.step(deltas, before)
        if before is None or not self.mu or not state.converged:
            return state
        shares = [
            (target - solved.delta_a) / far
            for target, solved, far in zip(deltas, before.solved, self.longest, strict=True)
        ]
        was, now = (set(each.pairs.slots[each.push.any(axis=1)].tolist()) for each in (before, state))
        swapped = bool(was - now and now - was) and np.abs(np.concatenate(shares)).max() > SHORT
        return replace(state, status=StepStatus.SWAPPED) if swapped else state

    def step(self, deltas: Sequence[np.ndarray], before: SurfacesState | None) -> SurfacesState:
        """One quasi-static step to deltas from the state `before` (none: at rest)."""
        work = _Step(self, [np.asarray(delta, float) for delta in deltas], before)
        status = None if all(solved.converged for solved in work.solved) else StepStatus.NO_EQUILIBRIUM
        try:
            while status is None:
                status = work.round() if work.iterations < ITERATIONS else StepStatus.ITERATIONS
        except (SingularMatrixError, np.linalg.LinAlgError):
            status = StepStatus.NO_EQUILIBRIUM
        return work.result(status)


class _Step:
    """One step on its way: of all N patches, places (N, 3) mm, forces (N, 3) N, and which are contact points, points
    (c,)."""

    def __init__(self, scene: SurfaceScene, deltas: Sequence[np.ndarray], before: SurfacesState | None):
        """Begins at the state `before`, None: at the robots alone at these actuators."""
        self.of, self.iterations, self._cost = scene, 0, SolveCost()
        self.memory, self.modes, self.residual = Memory(), {}, np.inf
        self._acceleration = Acceleration()
        self.points, self._answer = np.zeros(0, dtype=np.int64), None
        self.forces = np.zeros((scene.ends[-1][1], 3))
        self.faces: dict[int, np.ndarray] = {}  # of what has touched in this step
        self._touched: set[int] = set()  # slots, in this step
        self._pushed: dict[int, np.ndarray] = {}
        self._begin: np.ndarray | None = None  # places (N, 3) mm of the state before
        self._pressed_at_begin: dict[int, np.ndarray] = {}  # N, as `_pushed`
        self._gaps_at_begin: dict[int, float] = {}  # mm
        self._slid: dict[int, np.ndarray] = {}  # mm, of pairs before the last part of the step
        self._from_state = before is not None
        if before is None:
            each = zip(scene.robots, deltas, strict=True)
            self.solved = [
                solve(robot.problem, displacement(delta), settings=STRICT, wanted=Wanted(condense=False))
                for robot, delta in each
            ]
            self._cost.factorizations = sum(solved.factorizations for solved in self.solved)
            if not all(solved.converged for solved in self.solved):
                return
        else:
            self.memory, self.solved = before.memory, list(before.solved)
            self.forces[before.points] = before.forces
            self._pushed = dict(zip(before.pairs.slots.tolist(), before.push, strict=True))
            self._pressed_at_begin = self._pushed
            self._gaps_at_begin = dict(zip(before.pairs.slots.tolist(), before.pairs.gaps.tolist(), strict=True))
        each = zip(scene.robots, deltas, self.solved, strict=True)
        self.robots = [PressedRobot(robot, delta, solved, self._cost) for robot, delta, solved in each]

    def round(self) -> StepStatus | None:
        """One correction; None: another one is needed."""
        self.iterations += 1
        self._look([robot.at.x for robot in self.robots])
        if self.iterations == 1 and self._from_state:
            self._begin = self.places
        self.pairs = self.pairs.some(self.of.surroundings.entered(self.pairs, self.places, self._begin, self.memory))
        near = self.pairs.some(self.pairs.gaps < self._margin).used
        points = np.union1d(np.union1d(self.points, near), np.flatnonzero(self.forces.any(axis=1)))
        if len(points) > MOST * len(self.of.robots):
            return StepStatus.MANY
        self._choose(points)
        if not self._correct():
            return StepStatus.NO_MODE
        if any([robot.worn() for robot in self.robots]) and not self._correct():
            return StepStatus.NO_MODE
        if self._settled():
            changes = [robot.change_slack() for robot in self.robots]
            if None in changes:
                return StepStatus.NO_EQUILIBRIUM
            return None if any(changes) else self._solve()
        if not all([robot.advance() for robot in self.robots]):
            return StepStatus.NO_EQUILIBRIUM
        self._take()
        return None

    @property
    def _margin(self) -> float:
        """mm: pairs whose gap is less join. Nodes, which are many, only where something has gone in, and as far from
        the surface as it has gone in."""
        margin = NEAR * self.of.surroundings.spacing
        if all(isinstance(robot.patches, Patches) for robot in self.of.robots):
            return margin
        return min(margin, -float(self.pairs.gaps.min(initial=0.0)))

    def _correct(self) -> bool:
        """Corrects all robots by the law on their linearisations. False where nothing obeys it."""
        linear = [robot.linear() for robot in self.robots]
        turns = [np.kron(np.eye(len(robot.patches)), robot.of.R) for robot in self.robots]
        each = list(zip(turns, linear, strict=True))
        C = block_diag(*(turn @ C @ turn.T for turn, (_, C) in each))
        shift = np.concatenate([turn @ shift for turn, (shift, _) in each]).reshape(-1, 3)
        others = np.setdiff1d(np.arange(len(self.places)), self.points)
        touching = self.pairs.some(~self.pairs.relative[:, others].any(axis=1))
        coming = self.places.copy()
        coming[self.points] += shift
        self.memory = self.memory.with_new(touching, self._begin, self.places, coming)
        moved = touching.relative @ (coming - self.places)
        slips = self.memory.slips(touching, coming) if self.of.mu else np.zeros((len(touching), 2))
        push = _of_slots(self._pushed, touching)
        gaps = np.column_stack([touching.gaps + (touching.frames[:, 0] * moved).sum(axis=1), slips])
        relative, forces = touching.relative[:, self.points], self.forces[self.points]
        begin = self._step_begin(touching) if self.iterations <= FOLLOWED else None
        if begin is None:
            gaps[:, 1:] -= (touching.frames[:, 1:] @ _of_slots(self._slid, touching)[:, :, None])[..., 0]
        self._answer = balance(relative, touching.frames, C, gaps, forces, push, self.of.mu, begin=begin)
        if self._answer is None:
            return False
        if begin is not None:
            self._slid = dict(zip(touching.slots.tolist(), self._answer.slid, strict=True))
        step, change, last = shift + self._answer.step, self._answer.forces - self.forces[self.points], self.residual
        self._change = float(np.abs(change).max(initial=0.0))
        self.residual = float(np.abs(step).max(initial=0.0))
        if not self._still and self._turning(touching):
            self._combine(touching, step, self.residual > FALLS * last)
            change = self._answer.forces - self.forces[self.points]
        for robot, mine in zip(self.robots, self._by_robot(self.points), strict=True):
            robot.correct((change[mine] @ robot.of.R).ravel())
        self._touching = touching
        return True

    def _turning(self, touching: Pairs) -> bool:
        """True where forces turn with soft surfaces: of soft pairs, and of facets and edges."""
        return not touching.at_nodes.all()

    def _combine(self, touching: Pairs, step: np.ndarray, slow: bool) -> None:
        """Takes the answers of the last rounds combined, as long as the same points may carry forces, where they come
        nearer slowly; step (c, 3) mm: by which this one moves them. The linearisation does not know how forces turn
        with soft surfaces."""
        push = np.zeros((self.of.surroundings.slots(self.of.obstacles), 3))
        push[touching.slots] = self._answer.push
        combined = self._acceleration.next(self.points.tobytes(), np.concatenate([push, self._answer.forces]), step)
        if combined is not None and slow:
            push, forces = np.split(combined, [len(push)])
            self._answer = self._answer.with_forces(push[touching.slots], forces, touching.frames, self.of.mu)

    def _step_begin(self, touching: Pairs) -> StepBegin | None:
        """Gaps and forces of these pairs at the begin of the step, None where friction is not followed along it."""
        scene = self.of
        if not scene.mu or scene.parts < 2 or self._begin is None:
            return None
        normal = touching.gaps_at(self.places, self._begin)
        at_nodes = touching.at_nodes
        normal[at_nodes] = scene.obstacles.nearest(self._begin[touching.points[at_nodes]])[0]
        gaps = np.column_stack([normal, self.memory.slips(touching, self._begin)])
        for row, slot in zip(gaps, touching.slots.tolist(), strict=True):
            if slot in self._gaps_at_begin:
                row[:] = self._gaps_at_begin[slot], 0.0, 0.0
        return StepBegin(gaps, _of_slots(self._pressed_at_begin, touching), scene.parts)

    @property
    def _still(self) -> bool:
        """True where the last correction has hardly moved a point, or changed a force."""
        largest = max(np.abs(self.forces).max(initial=0.0), *(robot.problem.force_floor for robot in self.robots))
        return self.residual <= TOLERANCE * self.of.length and self._change <= SAME * largest

    def _settled(self) -> bool:
        return self._still and all(robot.balanced for robot in self.robots)

    def _take(self) -> None:
        """Takes over the forces of robots that have gone on."""
        pushed = self._answer.push.any(axis=1)
        self._pushed = dict(zip(self._touching.slots.tolist(), self._answer.push, strict=True))
        touched = self._touching.some((self._touching.gaps <= 0) | pushed)
        self.faces |= touched.faces
        self._touched.update(touched.slots.tolist())
        for robot, ends in zip(self.robots, self.of.ends, strict=True):
            self.forces[ends[0] + robot.patches] = robot.forces @ robot.of.R.T

    def _solve(self) -> StepStatus:
        """Each robot alone, its patches held, has to carry the forces that were found."""
        self.modes = dict(zip(self._touching.slots.tolist(), self._answer.modes, strict=True))
        largest = np.abs(self.forces).max(initial=0.0)
        self.solved, changes = zip(*[robot.solved() for robot in self.robots], strict=True)
        self._cost.factorizations += sum(solved.factorizations for solved in self.solved)
        for robot, solved, change in zip(self.robots, self.solved, changes, strict=True):
            if not solved.converged or change > SAME * largest + robot.problem.force_floor:
                return StepStatus.NO_EQUILIBRIUM
        return StepStatus.CONVERGED

    def result(self, status: StepStatus) -> SurfacesState:
        """State in which the step ends; without pairs where it failed."""
        count, memory = self.of.ends[-1][1], self.memory
        if status is StepStatus.CONVERGED:
            self._look([equilibrium.state.x for equilibrium in self.solved])
            known = dict(zip(self._touching.slots.tolist(), self._answer.push, strict=True))
            push = _of_slots(known, self.pairs)
            memory = memory.slid(self._slid).after(self.pairs, self.places, self.modes)
        else:
            self.pairs, push = Pairs.none(count), np.zeros((0, 3))
        return SurfacesState(
            self.pairs,
            push,
            self.of.surroundings.bodies,
            status,
            tuple(self.solved),
            self.points,
            self.forces[self.points],
            self.modes,
            memory,
            self.residual,
            self.iterations,
            self._cost.factorizations,
        )

    def _look(self, nodes: Sequence[np.ndarray]) -> None:
        """Updates the places of all patches, and what is before them; nodes: x (n, 3) mm of each robot."""
        places, normals = [], []
        for robot, x in zip(self.of.robots, nodes, strict=True):
            surface = robot.surface(x)
            places.append(robot.patches.mean(surface))
            normals.append(robot.normals(surface))
        self.places = np.concatenate(places)
        near = self.of.surroundings
        self.pairs = near.pairs(self.places, np.concatenate(normals), self.faces, self.residual)
        if len(self.of.obstacles.t):
            self.pairs = self.pairs.joined(near.with_obstacles(self.places, self.of.obstacles, self._touched))

    def _by_robot(self, numbers: np.ndarray) -> list[np.ndarray]:
        """Patches of each robot among these numbers (c,), bool."""
        return [(numbers >= first) & (numbers < last) for first, last in self.of.ends]

    def _choose(self, points: np.ndarray) -> None:
        self.points = points
        each = zip(self.robots, self._by_robot(points), self.of.ends, strict=True)
        for robot, mine, (first, _) in each:
            robot.choose(points[mine] - first, self.forces[points[mine]] @ robot.of.R)


def _of_slots(push: Mapping[int, np.ndarray], pairs: Pairs) -> np.ndarray:
    """Forces (p, 3) N of pairs, from those of their slots, 0 where none is known."""
    return np.array([push.get(slot, np.zeros(3)) for slot in pairs.slots.tolist()]).reshape(-1, 3)
