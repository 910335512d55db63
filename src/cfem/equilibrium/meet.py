"""Robots by finite elements that touch each other, themselves and rigid obstacles, with friction: the truth for
`cfem.predict.meeting`.

Patches of the surfaces are contact points. Robots are solved with these held at trial places; condensation gives how
they yield; the law on pairs of a patch and what is before it (`cfem.contact.pairs`) gives the forces that patches
should carry, and these the next trial places."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.linalg import block_diag

from cfem.condensed.patches import Patches
from cfem.contact.facing import along, patch_normals
from cfem.contact.modes import Mode
from cfem.contact.pairs import Balance, Memory, Pairs, Pressing, Surroundings, balance
from cfem.contact.several import Several
from cfem.equilibrium.actuation import Actuation, displacement
from cfem.equilibrium.newton import Settings
from cfem.equilibrium.patch_compliance import with_patches
from cfem.equilibrium.problem import Problem
from cfem.equilibrium.quasi_static import all_carried_out
from cfem.equilibrium.robot import Robot
from cfem.equilibrium.solution import Equilibrium
from cfem.equilibrium.solve import solve
from cfem.equilibrium.touch import PlacedRobot, TouchStatus

NEAR = 0.4  # distances of patches: of pairs whose gap is less the patches are contact points
HELD = 0.9  # share of a patch's nodes that are held: it meets nothing
MOST = 60  # contact points of a robot
SHARE = 0.05  # of its reach: the longest way of an actuator in one step
TOLERANCE, ITERATIONS = 1e-8, 40  # of the length: the last step of any contact point; rounds
STRICT = Settings(tolerance=1e-11)


@dataclass(frozen=True, eq=False)
class Skinned:
    """A robot; nodes (m,) of its surface in the mesh, triangles (t, 3) of them, and the patches that cut it; R (3, 3)
    and t (3,) mm from its frame to the scene's; itself: whether it may touch itself."""

    robot: Robot
    nodes: np.ndarray
    triangles: np.ndarray
    patches: Patches
    R: np.ndarray = field(default_factory=lambda: np.eye(3))
    t: np.ndarray = field(default_factory=lambda: np.zeros(3))
    itself: bool = True

    @cached_property
    def problem(self) -> Problem:
        return Problem(self.robot)

    @cached_property
    def along(self) -> np.ndarray:
        return along(self.robot.X[self.nodes], self.triangles, self.patches)

    @cached_property
    def held_still(self) -> np.ndarray:
        return self.patches.mean(np.isin(self.nodes, self.robot.fixed).astype(float)) > HELD

    def surface(self, solved: Equilibrium) -> np.ndarray:
        """(m, 3) mm in the scene."""
        return solved.state.x[self.nodes] @ self.R.T + self.t


@dataclass(frozen=True)
class MetRobots(Pressing):
    """One state. solved: of each robot. Of all N patches, robot after robot: chosen (c,) the contact points, at (c, 3)
    mm in the scene, with forces (c, 3) N, and the robots that have them (`placed`). residual: mm, the last step of any
    contact point; factorizations: of all FE solves."""

    status: TouchStatus
    solved: tuple[Equilibrium, ...]
    chosen: np.ndarray
    at: np.ndarray
    forces: np.ndarray
    placed: tuple[PlacedRobot, ...]
    modes: Mapping[int, Mode]
    memory: Memory
    residual: float
    iterations: int
    factorizations: int

    @property
    def converged(self) -> bool:
        return self.status is TouchStatus.CONVERGED


@dataclass(frozen=True, eq=False)
class Meeting:
    """robots, the obstacles that all of them meet, and one coefficient of friction."""

    robots: Sequence[Skinned]
    obstacles: Several = field(default_factory=lambda: Several(()))
    mu: float = 0.0

    @property
    def length(self) -> float:
        return self.robots[0].robot.length

    @cached_property
    def ends(self) -> list[tuple[int, int]]:
        """Where the patches of each robot begin and end among all."""
        return list(pairwise(np.cumsum([0, *(len(one.patches) for one in self.robots)]).tolist()))

    @cached_property
    def surroundings(self) -> Surroundings:
        return Surroundings.of(self.robots, [one.itself for one in self.robots], self.length, self.obstacles)

    def go(self, deltas: Sequence[np.ndarray], before: MetRobots | None = None) -> MetRobots:
        """To deltas, (n_a,) mm each, from the state `before` (none: actuators at 0), in steps, which are halved
        where one fails. Never raises for numerical failure: the state where it ended says why."""
        ends = [np.asarray(one, float) for one in deltas]
        begins = [0.0 * end for end in ends] if before is None else [one.delta_a for one in before.solved]
        state = self.step(begins, None) if before is None else before
        longest = [SHARE * np.abs(one.robot.reach).max(axis=1) for one in self.robots]
        return all_carried_out(begins, ends, longest, state, self.step)

    def step(self, deltas: Sequence[np.ndarray], before: MetRobots | None) -> MetRobots:
        """One quasi-static step to deltas from the state `before` (none: at rest)."""
        work = _Step(self, [displacement(one) for one in deltas], before)
        status = None if all(one.converged for one in work.solved) else TouchStatus.NO_EQUILIBRIUM
        while status is None:
            status = work.round() if work.iterations < ITERATIONS else TouchStatus.ITERATIONS
        return work.result(status)


class _Step:
    def __init__(self, of: Meeting, actuators: Sequence[Actuation], before: MetRobots | None):
        self.of, self.actuators = of, actuators
        self.iterations = self.cost = 0
        self.memory, self.modes, self.residual = Memory(), {}, np.inf
        self.chosen, self.at, self.forces = np.zeros(0, dtype=np.int64), np.zeros((0, 3)), np.zeros((0, 3))
        self.placed: tuple[PlacedRobot, ...] = ()
        self.found: Balance | None = None
        self.faces: dict[int, np.ndarray] = {}  # of what has touched in this step
        self._touching: Pairs | None = None
        states = [None] * len(of.robots)
        if before is not None:
            self.memory, states = before.memory, [one.state for one in before.solved]
            self.chosen, self.at, self.forces, self.placed = before.chosen, before.at, before.forces, before.placed
            self.solved = list(before.solved)
        if not self.placed:
            each = zip(of.robots, actuators, states, strict=True)
            self.solved = [solve(one.problem, at, base=base, settings=STRICT) for one, at, base in each]
            self.cost = sum(one.factorizations for one in self.solved)

    def round(self) -> TouchStatus | None:
        """None: another one is needed."""
        self.iterations += 1
        self._look()
        chosen = np.union1d(self.chosen, self.pairs.some(self.pairs.gaps < NEAR * self.of.surroundings.spacing).used)
        if not len(chosen):
            self.residual = 0.0
            return TouchStatus.CONVERGED
        if len(chosen) > MOST * len(self.of.robots):
            return TouchStatus.MANY
        if len(chosen) > len(self.chosen):
            self._widen(chosen)
        soft = self._respond()
        if soft is None:
            return TouchStatus.NO_EQUILIBRIUM
        self._look()
        others = np.setdiff1d(np.arange(len(self.places)), chosen)
        touching = self.pairs.some(~self.pairs.relative[:, others].any(axis=1))
        self.memory = self.memory.with_new(touching, self.places)
        slips = self.memory.slips(touching, self.places) if self.of.mu else np.zeros((len(touching), 2))
        push = np.zeros((len(touching), 3))
        self.found = balance(touching, chosen, soft, self.forces, push, slips, self.of.mu)
        if self.found is None:
            return TouchStatus.NO_MODE
        self.faces = touching.some((touching.gaps <= 0) | self.found.push.any(axis=1)).faces | self.faces
        self._touching, self.at = touching, self.at + self.found.step
        self.modes = dict(zip(touching.slots.tolist(), self.found.modes, strict=True))
        self.residual = float(np.abs(self.found.step).max())
        return TouchStatus.CONVERGED if self.residual <= TOLERANCE * self.of.length else None

    def result(self, status: TouchStatus) -> MetRobots:
        if all(one.converged for one in self.solved):
            self._look()
            push = np.zeros((len(self.pairs), 3))
            if self.found is not None:
                known = dict(zip(self._touching.slots.tolist(), self.found.push, strict=True))
                push = np.array([known.get(slot, np.zeros(3)) for slot in self.pairs.slots.tolist()]).reshape(-1, 3)
            memory = self.memory.after(self.pairs, self.places, self.modes)
        else:
            self.pairs, push, memory = Pairs.none(self.of.ends[-1][1]), np.zeros((0, 3)), self.memory
        return MetRobots(
            self.pairs,
            push,
            self.of.surroundings.bodies,
            status,
            tuple(self.solved),
            self.chosen,
            self.at,
            self.forces,
            self.placed,
            self.modes,
            memory,
            self.residual,
            self.iterations,
            self.cost,
        )

    def _look(self) -> None:
        """Where all patches are, and what is before them."""
        places, normals = [], []
        for one, state in zip(self.of.robots, self.solved, strict=True):
            surface = one.surface(state)
            places.append(one.patches.mean(surface))
            normals.append(patch_normals(surface, one.triangles, one.patches.of, len(one.patches)))
        self.places = np.concatenate(places)
        self.pairs = self.of.surroundings.pairs(self.places, np.concatenate(normals), self.faces)

    def _mine(self, numbers: np.ndarray) -> list[np.ndarray]:
        """Of each robot, which of these patches are its own, bool."""
        return [(numbers >= first) & (numbers < last) for first, last in self.of.ends]

    def _widen(self, chosen: np.ndarray) -> None:
        """These patches are contact points from here on, in the states in which the robots stand."""
        forces, placed = np.zeros((len(self.places), 3)), []
        forces[self.chosen] = self.forces
        self.chosen, self.at, self.forces = chosen, self.places[chosen], forces[chosen]
        for i, (one, mine) in enumerate(zip(self.of.robots, self._mine(chosen), strict=True)):
            numbers, solved = chosen[mine] - self.of.ends[i][0], self.solved[i]
            touched = with_patches(one.robot, one.nodes, one.patches, numbers)
            placed.append(PlacedRobot(Problem(touched), one.R, one.t))
            lam = np.concatenate([solved.lambda_a, (self.forces[mine] @ one.R).ravel()])
            self.solved[i] = replace(solved, state=replace(solved.state, lam=lam))
        self.placed = tuple(placed)

    def _respond(self) -> np.ndarray | None:
        """(3 c, 3 c) mm/N how the contact points yield, held where they are tried; None where a robot has no state."""
        blocks, self.forces = [], np.zeros_like(self.forces)
        for i, (one, at, mine) in enumerate(zip(self.placed, self.actuators, self._mine(self.chosen), strict=True)):
            moved = (self.at[mine] - one.points) @ one.turn
            self.solved[i], soft = one.respond(at, moved.ravel(), self.solved[i])
            self.cost += self.solved[i].factorizations
            if not self.solved[i].converged:
                return None
            turn = np.kron(np.eye(int(mine.sum())), one.turn)
            blocks.append(turn @ (soft + soft.T) @ turn.T / 2)
            self.forces[mine] = self.solved[i].lambda_c.reshape(-1, 3) @ one.turn.T
        return block_diag(*blocks)
