"""Learned robots that touch each other, or one that touches itself, at actuators that are held. Without friction.

Patches that face each other (`cfem.contact.facing`), and how they yield (`cfem.predict.touchable`), make one contact
problem, posed again where the patches have come to until neither forces nor the patches that touch change. Nothing is
retrained: two robots are two models, and a robot that curls onto itself is one that meets itself."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from scipy.linalg import block_diag

from cfem.contact.facing import Facing, facing, may_meet, patch_normals
from cfem.core.errors import InputError
from cfem.predict.held import Held
from cfem.predict.touchable import Touchable
from cfem.predict.touching import ITERATIONS, MOST, OVERLAP, TOLERANCE, TouchedStatus
from cfem.predict.touching_round import pressed

APART = 0.3  # of the length: patches of one robot that are nearer along its surface never meet
INSIDE = 1e-3  # of the length: by how much robots may overlap where they begin
SHARE = 0.05  # of its reach: the longest way of an actuator in one step


@dataclass(frozen=True)
class PlacedModel:
    """A learned robot; R (3, 3) and t (3,) mm from its frame to the scene's."""

    touchable: Touchable
    R: np.ndarray = field(default_factory=lambda: np.eye(3))
    t: np.ndarray = field(default_factory=lambda: np.zeros(3))


@dataclass(frozen=True)
class Met:
    """One state at `deltas`. forces: (N, 3) N on the patches of each robot, places (N, 3) mm of these, both in the
    scene; push (all N, 3) N: of these, what patches feel of what is before them; gap: mm, the smallest; pressed: N, the
    sum of the normal forces; delta_e (n_e,) mm and lambda_a (n_a,) N of each robot, in its own frame; rows: of its
    skin."""

    status: TouchedStatus
    deltas: list[np.ndarray]
    push: np.ndarray
    forces: list[np.ndarray]
    places: list[np.ndarray]
    gap: float
    pressed: float
    delta_e: list[np.ndarray]
    lambda_a: list[np.ndarray]
    rows: list[np.ndarray]
    iterations: int

    @property
    def converged(self) -> bool:
        return self.status is TouchedStatus.CONVERGED


def spacing_of(rest: np.ndarray) -> float:
    """mm: the distance of neighbouring patches, at rest (N, 3) mm, the median."""
    apart = np.linalg.norm(rest[:, None] - rest, axis=2) + 1e9 * np.eye(len(rest))
    return float(np.median(apart.min(axis=1)))


def meet(robots: Sequence[PlacedModel], deltas: Sequence[np.ndarray], before: Met | None = None) -> Met:
    """Robots at deltas, (n_a,) mm each; one robot: it meets itself. The way there from the state `before` (none: their
    actuators at 0) is gone in steps, as who is before whom depends on it. Never raises for numerical failure: the state
    where it ended says why. InputError where they overlap at the begin."""
    ends = [np.asarray(one, float) for one in deltas]
    begins = [np.zeros(len(one)) for one in ends] if before is None else before.deltas
    longest = [SHARE * np.abs(one.touchable.model.reach).max(axis=1) for one in robots]
    ways = [np.abs(end - begin) / most for begin, end, most in zip(begins, ends, longest, strict=True)]
    count = max(1, int(np.ceil(max(one.max() for one in ways))))
    if before is None:
        _demand_apart(_Meeting(robots, begins))
    for share in np.arange(1, count + 1) / count:
        before = _step(robots, [a + share * (b - a) for a, b in zip(begins, ends, strict=True)], before)
        if not before.converged:
            break
    return before


def _demand_apart(rest: "_Meeting") -> None:
    gap = rest.facing().gaps.min(initial=np.inf)
    if gap < -INSIDE * rest.length:
        raise InputError(f"the robots overlap by {-gap:.3g} mm where their actuators are at 0", do="move one of them")


def _step(robots: Sequence[PlacedModel], deltas: Sequence[np.ndarray], before: Met | None) -> Met:
    step = _Meeting(robots, deltas)
    if before is not None:
        step.forces, step.push = np.concatenate(before.forces), before.push
    status = None
    while status is None:
        status = step.round() if step.iterations < ITERATIONS else TouchedStatus.ITERATIONS
    return step.result(status)


class _Meeting:
    """Rounds of one state. Of all patches of all robots: forces (N, 3) N, push (N, 3) N those as points."""

    def __init__(self, robots: Sequence[PlacedModel], deltas: Sequence[np.ndarray]):
        self.robots, self.iterations = robots, 0
        self.held: list[Held] = [Held(one.touchable, delta) for one, delta in zip(robots, deltas, strict=True)]
        counts = [len(one.touchable.patches) for one in robots]
        ends = np.cumsum([0, *counts])
        self.own = [slice(int(a), int(b)) for a, b in pairwise(ends)]
        self.length = robots[0].touchable.model.length
        self.may_meet = may_meet([one.touchable.along for one in robots], APART * self.length)
        self.spacing = max(spacing_of(one.touchable.patches.rest) for one in robots)
        self.forces, self.push = np.zeros((ends[-1], 3)), np.zeros((ends[-1], 3))
        self._touching: frozenset[int] = frozenset()

    def round(self) -> TouchedStatus | None:
        """None: another one is needed."""
        self.iterations += 1
        near = self.facing()
        touching = near.some(np.flatnonzero((near.gaps <= 0) | self.push[near.points].any(axis=1)))
        if not len(touching.points):
            free = not self.forces.any()
            self.forces[:], self.push[:] = 0.0, 0.0
            return TouchedStatus.CONVERGED if free else None
        if len(touching.points) > MOST:
            return TouchedStatus.MANY
        chosen = np.union1d(np.flatnonzero(touching.relative.any(axis=0)), np.flatnonzero(self.forces.any(axis=1)))
        C = self._compliance(chosen)
        B = np.kron(touching.relative[:, chosen], np.eye(3))
        gap = np.zeros((len(touching.points), 3))
        gap[:, 0] = touching.gaps
        known = np.einsum("pij,pj->pi", touching.frames, self.push[touching.points])
        known[:, 1:] = 0.0
        W, now = B @ C @ B.T, np.einsum("pij,pi->pj", touching.frames, known)
        gap -= np.einsum("pij,pj->pi", touching.frames, self._moved(B, C, now, chosen))
        answer = pressed(W, gap, touching.frames, known, 0.0)
        if answer is None:
            return TouchedStatus.NO_MODE
        force = np.einsum("pij,pi->pj", touching.frames, answer[1])
        step = C @ (B.T @ force.ravel() - self.forces[chosen].ravel())
        self.push[:], self.forces[:] = 0.0, 0.0
        self.push[touching.points] = force
        self.forces[chosen] = (B.T @ force.ravel()).reshape(-1, 3)
        same = frozenset(touching.points.tolist()) == self._touching
        self._touching = frozenset(touching.points.tolist())
        open_ones = ~np.isin(near.points, touching.points)
        clear = near.gaps[open_ones].min(initial=np.inf) >= -OVERLAP * self.length
        settled = np.abs(step).max() <= 10 * TOLERANCE * self.length
        return TouchedStatus.CONVERGED if same and clear and settled else None

    def _moved(self, B: np.ndarray, C: np.ndarray, now: np.ndarray, chosen: np.ndarray) -> np.ndarray:
        """(p, 3) mm by which gaps would differ if the forces that are there were those `now` (p, 3) N of the points."""
        return (B @ (C @ (self.forces[chosen].ravel() - B.T @ now.ravel()))).reshape(-1, 3)

    def _each(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Of each robot in its own frame: patches that carry forces, and these."""
        found = []
        for robot, own in zip(self.robots, self.own, strict=True):
            forces = self.forces[own] @ robot.R
            chosen = np.flatnonzero(forces.any(axis=1))
            found.append((chosen, forces[chosen]))
        return found

    def facing(self) -> Facing:
        places, normals = [], []
        for robot, held, (chosen, forces) in zip(self.robots, self.held, self._each(), strict=True):
            of, skin = robot.touchable.patches, robot.touchable.model.skin
            held.bear(chosen, forces)
            places.append(held.places() @ robot.R.T + robot.t)
            normals.append(patch_normals(skin.surface(held.rows), skin.triangles, of.of, len(of)) @ robot.R.T)
        self.places = places
        return facing(np.concatenate(places), np.concatenate(normals), self.may_meet, self.spacing)

    def _compliance(self, chosen: np.ndarray) -> np.ndarray:
        """(3 c, 3 c) mm/N of chosen patches, in the scene."""
        blocks = []
        for robot, held, own in zip(self.robots, self.held, self.own, strict=True):
            mine = chosen[(chosen >= own.start) & (chosen < own.stop)] - own.start
            turn = np.kron(np.eye(len(mine)), robot.R)
            held.bear(mine, self.forces[mine + own.start] @ robot.R)
            blocks.append(turn @ held.compliance() @ turn.T if len(mine) else np.zeros((0, 0)))
        return block_diag(*blocks)

    def result(self, status: TouchedStatus) -> Met:
        near = self.facing()
        delta_e, lambda_a, rows = [], [], []
        for robot, held in zip(self.robots, self.held, strict=True):
            base = robot.touchable.model.at_displacement(held.delta)
            delta_e.append(base.delta_e + held.tip())
            lambda_a.append(base.lambda_a - held.relief())
            rows.append(held.rows)
        size = float(np.linalg.norm(self.push, axis=1).sum())
        forces = [self.forces[own].copy() for own in self.own]
        gap = float(near.gaps.min(initial=np.inf))
        deltas = [one.delta for one in self.held]
        return Met(status, deltas, self.push, forces, self.places, gap, size, delta_e, lambda_a, rows, self.iterations)
