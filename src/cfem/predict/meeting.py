"""Learned robots that touch each other, themselves and rigid obstacles, at actuators that are held, with friction.

Pairs of a patch and the surface before it (`cfem.contact.pairs`), and how patches yield (`cfem.predict.touchable`),
make one contact problem, posed again where the patches have come to until neither forces nor the pairs that touch
change. Nothing is retrained: two robots are two models, and a robot that curls onto itself is one that meets itself."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.linalg import block_diag

from cfem.contact.detection import NEVER, patch_normals, separation
from cfem.contact.modes import Mode
from cfem.contact.obstacle_set import ObstacleSet
from cfem.contact.pairs import Memory, Pairs, Pressing, Surroundings, balance
from cfem.contact.problem import demand_friction
from cfem.core.errors import InputError
from cfem.equilibrium.quasi_static import all_carried_out
from cfem.predict.held import Held
from cfem.predict.slack import with_slack
from cfem.predict.touchable import Touchable
from cfem.predict.touching import OVERLAP, TOLERANCE, TouchedStatus

INSIDE = 1e-3  # of the length: by how much robots may overlap where they begin
SHARE = 0.05  # of its reach: the longest way of an actuator in one step
ITERATIONS = 30
MOST = 60  # pairs that may touch at once
NEAR = 0.1  # distances of patches: of pairs that are farther apart nothing local is known in the next step


@dataclass(frozen=True)
class PlacedModel:
    """A learned robot; R (3, 3) and t (3,) mm from its frame to the scene's; itself: whether it may touch itself;
    unilateral (n_a,) bool: actuators that go slack where they would push (`cfem.predict.slack`), none where it is None:
    the others are held."""

    touchable: Touchable
    R: np.ndarray = field(default_factory=lambda: np.eye(3))
    t: np.ndarray = field(default_factory=lambda: np.zeros(3))
    itself: bool = True
    unilateral: np.ndarray | None = None


@dataclass(frozen=True)
class Met(Pressing):
    """One state at `deltas`. Of all N patches, robot after robot, in the scene: forces (N, 3) N, places (N, 3) mm, and
    chosen (c,), those whose pairs are near. modes: of pairs that touch, by slot; memory: from where slip is counted;
    delta_e (n_e,) mm and lambda_a (n_a,) N of each robot, in its own frame; rows: of its skin; bending: largest of
    `Touched.bending`."""

    status: TouchedStatus
    deltas: list[np.ndarray]
    forces: np.ndarray
    places: np.ndarray
    chosen: np.ndarray
    modes: Mapping[int, Mode]
    memory: Memory
    delta_e: list[np.ndarray]
    lambda_a: list[np.ndarray]
    rows: list[np.ndarray]
    bending: float
    iterations: int

    @property
    def converged(self) -> bool:
        return self.status is TouchedStatus.CONVERGED

    @property
    def pull(self) -> np.ndarray:
        """(n,) N of the actuators of all robots, robot after robot."""
        return np.concatenate(self.lambda_a)


@dataclass(frozen=True, eq=False)
class Meeting:
    """robots, the obstacles that all of them meet, and one coefficient of friction."""

    robots: Sequence[PlacedModel]
    obstacles: ObstacleSet = field(default_factory=lambda: ObstacleSet(()))
    mu: float = 0.0

    def __post_init__(self) -> None:
        demand_friction(self.mu)

    @cached_property
    def own(self) -> list[slice]:
        """Patches of each robot among all."""
        ends = np.cumsum([0, *(len(one.touchable.patches) for one in self.robots)])
        return [slice(int(a), int(b)) for a, b in pairwise(ends)]

    @property
    def length(self) -> float:
        return self.robots[0].touchable.model.length

    @cached_property
    def unilateral(self) -> np.ndarray:
        """(n,) bool of the actuators of all robots, robot after robot."""
        none = [np.zeros(one.touchable.model.rows.n_a, dtype=bool) for one in self.robots]
        each = zip(self.robots, none, strict=True)
        return np.concatenate([held if one.unilateral is None else one.unilateral for one, held in each])

    @cached_property
    def surroundings(self) -> Surroundings:
        each = [one.touchable for one in self.robots]
        return Surroundings.of(each, [one.itself for one in self.robots], self.length, self.obstacles)

    def go(self, deltas: Sequence[np.ndarray], before: Met | None = None) -> Met:
        """To deltas, (n_a,) mm each, in steps from the state `before` (none: actuators at 0), as who is before whom,
        and friction, depend on the way; one that fails is halved. Never raises for numerical failure: the state where
        it ended says why. InputError where they overlap at the begin."""
        before = self.start([np.zeros(len(one)) for one in deltas]) if before is None else before
        longest = [SHARE * np.abs(one.touchable.model.reach).max(axis=1) for one in self.robots]
        ends = [np.asarray(one, float) for one in deltas]
        begins = [  # a slack cable is where no target above it has been
            np.where(lam == 0.0, np.minimum(at, end), at) if one.unilateral is not None else at
            for one, at, end, lam in zip(self.robots, before.deltas, ends, before.lambda_a, strict=True)
        ]
        return all_carried_out(begins, ends, longest, before, self.step)

    def start(self, deltas: Sequence[np.ndarray]) -> Met:
        """Where they begin, with nothing pressed yet."""
        step = _Step(self, deltas, None)
        gap = step.pairs.gaps.min(initial=np.inf)
        if gap < -INSIDE * self.length:
            at = "are at 0" if not any(np.any(one) for one in deltas) else "begin"
            raise InputError(f"the robots overlap by {-gap:.3g} mm where their actuators {at}", do="move one of them")
        return step.run()

    def normals(self, rows: Sequence[np.ndarray]) -> np.ndarray:
        """(N, 3) outward of all patches in the scene, by the rows of each robot's skin."""
        found = []
        for robot, mine in zip(self.robots, rows, strict=True):
            of, skin = robot.touchable.patches, robot.touchable.model.skin
            found.append(patch_normals(skin.surface(mine), skin.triangles, of.of, len(of)) @ robot.R.T)
        return np.concatenate(found)

    def separation(self, state: Met, body: int, other: int) -> float:
        """mm, the smallest gap of two bodies, or of one and itself, that do not press each other."""
        here, there = (self.surroundings.bodies == one for one in (body, other))
        both = here[:, None] & there | there[:, None] & here
        may = np.where(both, self.surroundings.may_meet, NEVER)
        return separation(state.places, self.normals(state.rows), may, self.surroundings.spacing)

    def step(self, deltas: Sequence[np.ndarray], before: Met, of_first: np.ndarray | None = None) -> Met:
        """One quasi-static step, which ends as `go` does. of_first (n_a,) bool: `unilateral` of the first robot now."""
        cuts, unilateral = np.cumsum([len(one) for one in deltas])[:-1], self.unilateral.copy()
        if of_first is not None:
            unilateral[: len(of_first)] = of_first
        target = np.concatenate([np.asarray(one, float) for one in deltas])

        def held(at: np.ndarray) -> Met:
            return _Step(self, np.split(at, cuts), before).run()

        if not unilateral.any():
            return held(target)
        models, known = [one.touchable.model for one in self.robots], (np.concatenate(before.deltas), before.pull)
        found, slack, settled = with_slack(held, models, unilateral, target, known)
        status = found.status if settled else TouchedStatus.ITERATIONS
        return replace(found, status=status, lambda_a=np.split(np.where(slack, 0.0, found.pull), cuts))


def meet(
    robots: Sequence[PlacedModel],
    deltas: Sequence[np.ndarray],
    before: Met | None = None,
    obstacles: ObstacleSet | None = None,
    mu: float = 0.0,
) -> Met:
    """`Meeting.go`. One robot meets itself; mu: of friction."""
    return Meeting(robots, obstacles or ObstacleSet(()), mu).go(deltas, before)


class _Step:
    """Rounds of one step. Of all patches: forces (N, 3) N; chosen (c,): those whose local motion is known; pushed: of
    pairs that touch, (3,) N by slot."""

    def __init__(self, of: Meeting, deltas: Sequence[np.ndarray], before: Met | None):
        self.of, self.iterations, count = of, 0, of.own[-1].stop
        self.held = [Held(one.touchable, delta) for one, delta in zip(of.robots, deltas, strict=True)]
        self.forces, self.chosen = np.zeros((count, 3)), np.zeros(0, dtype=np.int64)
        self.pushed: dict[int, np.ndarray] = {}
        self.memory, self.modes = Memory(), {}
        if before is not None:
            self.forces, self.chosen, self.memory = before.forces.copy(), before.chosen, before.memory
            touching = before.push.any(axis=1)
            self.pushed = dict(zip(before.pairs.slots[touching].tolist(), before.push[touching], strict=True))
        self._touching: frozenset[int] = frozenset()
        self.faces: dict[int, np.ndarray] = {}  # of what has touched in this step
        self._moved = np.inf
        self._begin = None if before is None else before.places
        self._place()
        if before is None:
            self._look()
        else:
            self.pairs = of.surroundings.onwards(before.pairs, self.places)

    def run(self) -> Met:
        status = None
        while status is None:
            status = self._round() if self.iterations < ITERATIONS else TouchedStatus.ITERATIONS
        return self._result(status)

    def _round(self) -> TouchedStatus | None:
        """None: another one is needed."""
        self.iterations += 1
        touching = self._now_touching()
        if not len(touching):
            free = not self.forces.any()
            self.forces, self.pushed, self.modes = np.zeros_like(self.forces), {}, {}
            self._look()
            return TouchedStatus.CONVERGED if free and (self.pairs.gaps[self._entered()] > 0).all() else None
        if len(touching) > MOST:
            return TouchedStatus.MANY
        new = np.setdiff1d(touching.used, self.chosen)
        if len(new):
            self.chosen = np.union1d(self.chosen, new)
            self._place()
            self.pairs = self.of.surroundings.onwards(self.pairs, self.places)
            touching = self._now_touching()
            if not np.isin(touching.used, self.chosen).all():
                return None
        self.memory = self.memory.with_new(touching, self._begin, self.places)
        self.faces |= touching.faces
        slips = self.memory.slips(touching, self.places) if self.of.mu else np.zeros((len(touching), 2))
        push = np.array([self.pushed.get(slot, np.zeros(3)) for slot in touching.slots.tolist()])
        found = None
        for pressed in (True, False):  # under large forces the derivative may be indefinite, which the other is not
            C = self._compliance(pressed)
            found = balance(touching, self.chosen, C, self.forces[self.chosen], push, slips, self.of.mu)
            if found is not None:
                break
        if found is None:
            return TouchedStatus.NO_MODE
        slots = touching.slots.tolist()
        self.modes = dict(zip(slots, found.modes, strict=True))
        self.pushed = {slot: one for slot, one in zip(slots, found.push, strict=True) if one.any()}
        self.forces = np.zeros_like(self.forces)
        self.forces[self.chosen] = found.forces
        same, self._touching = frozenset(slots) == self._touching, frozenset(slots)
        self._moved = float(np.abs(found.step).max())
        self._look()
        open_ones = ~np.isin(self.pairs.slots, slots) & self._entered()
        clear = self.pairs.gaps[open_ones].min(initial=np.inf) >= -OVERLAP * self.of.length
        settled = self._moved <= 10 * TOLERANCE * self.of.length
        return TouchedStatus.CONVERGED if same and clear and settled else None

    def _now_touching(self) -> Pairs:
        slots = self.pairs.slots.tolist()
        touching = (self.pairs.gaps <= 0) | np.array([one in self.pushed for one in slots], dtype=bool)
        return self.pairs.some(touching & self._entered())

    def _entered(self) -> np.ndarray:
        return self.of.surroundings.entered(self.pairs, self.places, self._begin, self.memory)

    def _place(self) -> None:
        """Where all patches are under the forces."""
        places = []
        for robot, held, own in zip(self.of.robots, self.held, self.of.own, strict=True):
            mine = self.chosen[(self.chosen >= own.start) & (self.chosen < own.stop)]
            held.bear(mine - own.start, self.forces[mine] @ robot.R)
            places.append(held.places() @ robot.R.T + robot.t)
        self.places = np.concatenate(places)

    def _look(self) -> None:
        """And what is before them."""
        self._place()
        normals = self.of.normals([held.rows for held in self.held])
        self.pairs = self.of.surroundings.pairs(self.places, normals, self.faces, self._moved)

    def _compliance(self, pressed: bool) -> np.ndarray:
        """(3 c, 3 c) mm/N of chosen patches, in the scene; pressed: as the forces have changed it."""
        blocks = []
        for robot, held in zip(self.of.robots, self.held, strict=True):
            turn = np.kron(np.eye(len(held.chosen)), robot.R)
            C = held.compliance() if pressed else held.unpressed(held.chosen)
            blocks.append(turn @ C @ turn.T)
        return block_diag(*blocks)

    def _result(self, status: TouchedStatus) -> Met:
        delta_e, lambda_a = [], []
        for robot, held in zip(self.of.robots, self.held, strict=True):
            base, pressed = robot.touchable.model.at_displacement(held.delta), held.forces.any()
            delta_e.append(base.delta_e + (held.tip() if pressed else 0.0))
            lambda_a.append(base.lambda_a - (held.relief() if pressed else 0.0))
        push = [self.pushed.get(slot, np.zeros(3)) for slot in self.pairs.slots.tolist()]
        near = self.pairs.some(self.pairs.gaps < NEAR * self.of.surroundings.spacing)
        return Met(
            self.pairs,
            np.array(push).reshape(-1, 3),
            self.of.surroundings.bodies,
            status,
            [one.delta for one in self.held],
            self.forces,
            self.places,
            np.intersect1d(self.chosen, np.union1d(near.used, np.flatnonzero(self.forces.any(axis=1)))),
            self.modes,
            self.memory.after(self.pairs, self.places, self.modes),
            delta_e,
            lambda_a,
            [one.rows for one in self.held],
            max(one.bending for one in self.held),
            self.iterations,
        )
