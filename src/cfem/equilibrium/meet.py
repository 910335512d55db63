"""Robots by finite elements that touch each other, or one that touches itself: the truth for `cfem.predict.meeting`.

Patches of the surfaces are contact points. Robots are solved with these held at trial places; condensation gives how
they yield; the law on what patches have before them (`cfem.contact.facing`) gives the forces that patches should carry,
and these the next trial places. Without friction."""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.linalg import block_diag

from cfem.condensed.patches import Patches
from cfem.contact.facing import Facing, along, facing, may_meet, patch_normals
from cfem.contact.problem import ContactProblem
from cfem.contact.solve import ContactStatus, solve_contact
from cfem.equilibrium.actuation import Actuation
from cfem.equilibrium.newton import Settings
from cfem.equilibrium.patch_compliance import with_patches
from cfem.equilibrium.problem import Problem
from cfem.equilibrium.robot import Robot
from cfem.equilibrium.solution import Equilibrium
from cfem.equilibrium.solve import solve
from cfem.equilibrium.touch import PlacedRobot, TouchStatus

NEAR = 0.4  # distances of patches: points whose gap is less are contact points, with what they have before them


@dataclass(frozen=True)
class Skinned:
    """A robot; nodes (m,) of its surface in the mesh, triangles (t, 3) of them, and the patches that cut it; R (3, 3)
    and t (3,) mm from its frame to the scene's."""

    robot: Robot
    nodes: np.ndarray
    triangles: np.ndarray
    patches: Patches
    R: np.ndarray = field(default_factory=lambda: np.eye(3))
    t: np.ndarray = field(default_factory=lambda: np.zeros(3))


@dataclass(frozen=True)
class MetRobots:
    """solved: of each robot; pressed: N, the sum of the normal forces; gap: mm, the smallest; residual: mm, the last
    step of any contact point."""

    status: TouchStatus
    solved: tuple[Equilibrium, ...]
    pressed: float
    gap: float
    residual: float
    iterations: int
    work: "_Meeting"

    @property
    def converged(self) -> bool:
        return self.status is TouchStatus.CONVERGED


def meet(
    robots: Sequence[Skinned],
    actuators: Sequence[Actuation],
    apart: float,
    spacing: float,
    before: MetRobots | None = None,
    tolerance: float = 1e-8,
    iterations: int = 40,
) -> MetRobots:
    """A step to `actuators` from the state `before` (none: at rest); one robot: it meets itself. apart: mm, patches of
    one robot that are nearer along its surface never meet; spacing: mm of patches; tolerance: of the length. Never
    raises for numerical failure."""
    work = _Meeting(robots, actuators, apart, spacing) if before is None else before.work.further(actuators)
    if not work.converged:
        return work.result(TouchStatus.NO_EQUILIBRIUM, 0)
    for iteration in range(1, iterations + 1):
        status = work.round(tolerance)
        if status is not None:
            return work.result(status, iteration)
    return work.result(TouchStatus.ITERATIONS, iterations)


class _Meeting:
    def __init__(self, robots: Sequence[Skinned], actuators: Sequence[Actuation], apart: float, spacing: float):
        self.robots, self.actuators, self.spacing, self.apart = robots, actuators, spacing, apart
        counts = [len(one.patches) for one in robots]
        self.ends = np.cumsum([0, *counts])
        alongs = [along(one.robot.X[one.nodes], one.triangles, one.patches) for one in robots]
        self.may_meet = may_meet(alongs, apart)
        settings = Settings(tolerance=1e-11)
        each = zip(robots, actuators, strict=True)
        self.solved = [solve(Problem(one.robot), at, settings=settings) for one, at in each]
        self.chosen, self.placed = np.zeros(0, dtype=np.int64), []
        self.held: list[Equilibrium | None] = [None] * len(robots)
        self.forces, self.pressed, self.gap, self.residual = np.zeros((0, 3)), 0.0, np.inf, np.inf
        self.at = np.zeros((0, 3))

    @property
    def converged(self) -> bool:
        return all(one.converged for one in self.solved)

    def further(self, actuators: Sequence[Actuation]) -> "_Meeting":
        """From here to these: contact points stay where they are at first."""
        found = copy(self)
        found.actuators = actuators
        if not len(self.chosen):
            return _Meeting(self.robots, actuators, self.apart, self.spacing)
        found.held, found.solved = list(self.held), list(self.solved)
        return found

    def round(self, tolerance: float) -> TouchStatus | None:
        near = self._facing()
        wanted = near.some(np.flatnonzero(near.gaps < NEAR * self.spacing))
        if not len(wanted.points) or (near.gaps.min(initial=np.inf) > 0 and not len(self.chosen)):
            self.gap, self.residual = float(near.gaps.min(initial=np.inf)), 0.0
            return TouchStatus.CONVERGED
        chosen = np.union1d(self.chosen, np.flatnonzero(wanted.relative.any(axis=0)))
        if len(chosen) > len(self.chosen):
            self._widen(chosen)
        soft = self._respond()
        if not self.converged:
            return TouchStatus.NO_EQUILIBRIUM
        near = self._facing()
        others = np.setdiff1d(np.arange(self.ends[-1]), chosen)
        touching = near.some(np.flatnonzero(~near.relative[:, others].any(axis=1)))
        B, into = np.kron(touching.relative[:, chosen], np.eye(3)), block_diag(*touching.frames)
        gap = np.zeros((len(touching.points), 3))
        gap[:, 0] = touching.gaps
        yields = into @ B @ soft
        W = yields @ B.T @ into.T
        answer = solve_contact(ContactProblem((W + W.T) / 2, gap.ravel() - yields @ self.forces.ravel()), "signorini")
        if answer.status not in (ContactStatus.SOLVED, ContactStatus.SEVERAL):
            return TouchStatus.NO_MODE
        step = (soft @ (B.T @ into.T @ answer.lam - self.forces.ravel())).reshape(-1, 3)
        self.at, self.residual = self.at + step, float(np.abs(step).max())
        self.pressed, self.gap = float(answer.lam[::3].sum()), float(touching.gaps.min())
        return TouchStatus.CONVERGED if self.residual <= tolerance * self.robots[0].robot.length else None

    def _facing(self) -> Facing:
        places, normals = [], []
        for one, state in zip(self.robots, self.solved, strict=True):
            surface = state.state.x[one.nodes] @ one.R.T + one.t
            places.append(one.patches.mean(surface))
            normals.append(patch_normals(surface, one.triangles, one.patches.of, len(one.patches)))
        self.places = np.concatenate(places)
        return facing(self.places, np.concatenate(normals), self.may_meet, self.spacing)

    def _widen(self, chosen: np.ndarray) -> None:
        """These patches are contact points from here on, in the states in which the robots stand."""
        known = np.zeros((self.ends[-1], 3))
        known[self.chosen] = self.forces
        self.chosen, self.at, self.placed, self.held = chosen, self.places[chosen], [], []
        for one, solved, first, last in zip(self.robots, self.solved, self.ends[:-1], self.ends[1:], strict=True):
            mine = chosen[(chosen >= first) & (chosen < last)]
            touched = with_patches(one.robot, one.nodes, one.patches, mine - first)
            self.placed.append(PlacedRobot(Problem(touched), one.R, one.t))
            lam = np.concatenate([solved.lambda_a, (known[mine] @ one.R).ravel()])
            self.held.append(replace(solved, state=replace(solved.state, lam=lam)))

    def _respond(self) -> np.ndarray:
        """(3 c, 3 c) mm/N how the contact points yield, held where they are tried."""
        blocks, forces, first = [], [], 0
        for i, (one, at) in enumerate(zip(self.placed, self.actuators, strict=True)):
            last = first + len(one.points)
            moved = (self.at[first:last] - one.points) @ one.turn
            self.held[i], soft = one.respond(at, moved.ravel(), self.held[i])
            self.solved[i] = self.held[i]
            if not self.solved[i].converged:
                return np.zeros((0, 0))
            turn = np.kron(np.eye(last - first), one.turn)
            blocks.append(turn @ soft @ turn.T)
            forces.append(self.held[i].lambda_c.reshape(-1, 3) @ one.turn.T)
            first = last
        self.forces = np.concatenate(forces)
        return block_diag(*blocks)

    def result(self, status: TouchStatus, count: int) -> MetRobots:
        return MetRobots(status, tuple(self.solved), self.pressed, self.gap, self.residual, count, self)
