"""Equilibria of robots and one free rigid object between them: contact points that open, touch, stick and slide.

`press` with an obstacle that moves by itself. Every robot is solved by finite elements with its contact points held at
trial positions; condensation gives what they yield; the contact law on that linearisation, with the object's motion and
balance, is solved exactly (`cfem.contact.solve`); its displacements are the next trial positions and the next pose. The
last state is checked as it is: gaps, forces, cones and the object's balance."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation

from cfem.condensed.pose import cross_matrix
from cfem.contact.check import Check, check
from cfem.contact.modes import Mode
from cfem.contact.obstacle import Obstacle
from cfem.contact.problem import ContactProblem, Law
from cfem.contact.solve import ContactStatus, solve_contact
from cfem.equilibrium.actuation import Actuation
from cfem.equilibrium.held_patch import contact_points, held
from cfem.equilibrium.newton import Settings
from cfem.equilibrium.press import PressStatus, yields
from cfem.equilibrium.problem import Problem
from cfem.equilibrium.solution import Equilibrium
from cfem.equilibrium.solve import solve


@dataclass(frozen=True)
class Finger:
    """One robot; turn (3, 3) and shift (3,) mm from its frame to the scene's."""

    problem: Problem
    turn: np.ndarray
    shift: np.ndarray

    @property
    def points(self) -> np.ndarray:
        """(k, 3) mm its contact points at rest, in the scene."""
        return contact_points(self.problem) @ self.turn.T + self.shift


@dataclass(frozen=True)
class Free:
    """The object. shape: placed as at rest; centre (3,) mm; wrench (6,) N and N mm about the centre, constant; turns:
    whether it can turn, else it is guided."""

    shape: Obstacle
    centre: np.ndarray
    wrench: np.ndarray
    turns: bool = True


@dataclass(frozen=True)
class Grip:
    """One state. solved: of each robot, with multipliers of its contact points in its own frame; modes: of all points,
    robot after robot; R (3, 3), x (3,) mm: rotation and displacement of the object; stuck (m, 3) mm: the places on the
    object, in the scene at rest, where the points stick or would; check: of law and balance at the state itself;
    iterations: rounds of FE solves; factorizations: of them all."""

    status: PressStatus
    solved: tuple[Equilibrium, ...]
    modes: tuple[Mode, ...]
    R: np.ndarray
    x: np.ndarray
    stuck: np.ndarray
    check: Check | None
    iterations: int
    factorizations: int

    @property
    def converged(self) -> bool:
        return self.status is PressStatus.CONVERGED


def grip(
    fingers: Sequence[Finger],
    actuators: Sequence[Actuation],
    held_object: Free,
    law: Law = "coulomb",
    mu: float = 0.0,
    before: Grip | None = None,
    tolerance: float = 1e-8,
    iterations: int = 40,
) -> Grip:
    """Quasi-static step of the robots to `actuators`, one for each, from the state `before` (none: at rest, every point
    that touches the object sticks where it is). tolerance: of law and balance, relative. Never raises for numerical
    failure."""
    settings = Settings(tolerance=1e-11)
    points = np.concatenate([finger.points for finger in fingers])
    turns = block_diag(*[np.kron(np.eye(len(finger.points)), finger.turn) for finger in fingers])
    ends = np.cumsum([0, *(len(finger.points) for finger in fingers)])
    if before is None:
        at, R, x, stuck, modes = points.copy(), np.eye(3), np.zeros(3), points.copy(), ()
        solved: list[Equilibrium | None] = [None] * len(fingers)
    else:
        at = points + (turns @ np.concatenate([one.delta_c for one in before.solved])).reshape(-1, 3)
        R, x, stuck, modes = before.R, before.x, before.stuck, before.modes
        solved = list(before.solved)
    verdict, cost = None, 0

    def ended(status: PressStatus, count: int, where: np.ndarray = stuck) -> Grip:
        return Grip(status, tuple(solved), modes, R, x, where, verdict, count, cost)

    for iteration in range(1, iterations + 1):
        moved = turns.T @ (at - points).ravel()
        for i, (finger, actuation) in enumerate(zip(fingers, actuators, strict=True)):
            state = None if solved[i] is None else solved[i].state
            delta = moved[3 * ends[i] : 3 * ends[i + 1]]
            found = solve(finger.problem, held(actuation, delta), start=state, base=state, settings=settings)
            cost += found.factorizations
            if not found.converged:
                return ended(PressStatus.NO_EQUILIBRIUM, iteration)
            solved[i] = found
        shape, centre = _placed(held_object, R, x), held_object.centre + x
        frames = shape.frames(at)
        slip = at - ((stuck - held_object.centre) @ R.T + centre)
        gap = np.einsum("kij,kj->ki", frames, slip)
        gap[:, 0] = shape.distance(at)
        into = block_diag(*frames)
        compliance = block_diag(*[yields(one, how) for one, how in zip(solved, actuators, strict=True)])
        W = into @ turns @ compliance @ turns.T @ into.T
        force = into @ turns @ np.concatenate([one.lambda_c for one in solved])
        G = into @ _motion(at - centre, held_object.turns)
        posed = ContactProblem(
            (W + W.T) / 2, gap.ravel() - W @ force, G=G, wrench=held_object.wrench[: G.shape[1]], mu=mu
        )
        verdict = check(posed, law, force, np.zeros(G.shape[1]))
        if verdict.largest <= tolerance and modes:
            sticks = np.array([mode is Mode.STICK for mode in modes])[:, None]
            there = (at - centre) @ R + held_object.centre
            return ended(PressStatus.CONVERGED, iteration, np.where(sticks, stuck, there))
        answer = solve_contact(posed, law, modes or None)
        if answer.status not in (ContactStatus.SOLVED, ContactStatus.SEVERAL):
            return ended(PressStatus.NO_MODE, iteration)
        modes = answer.modes
        at = at + (turns @ compliance @ turns.T @ into.T @ (answer.lam - force)).reshape(-1, 3)
        x = x + answer.xi[:3]
        if held_object.turns:
            R = Rotation.from_rotvec(answer.xi[3:]).as_matrix() @ R
    return ended(PressStatus.ITERATIONS, iterations)


def _placed(held_object: Free, R: np.ndarray, x: np.ndarray) -> Obstacle:
    shape, centre = held_object.shape, held_object.centre
    return replace(shape, R=R @ shape.R, t=R @ (shape.t - centre) + centre + x)


def _motion(arms: np.ndarray, turns: bool) -> np.ndarray:
    """(3 m, 6) or (3 m, 3) displacement of the object's points at `arms` (m, 3) mm from its centre by its motion."""
    shift = np.tile(np.eye(3), (len(arms), 1))
    if not turns:
        return shift
    return np.hstack([shift, -np.concatenate([cross_matrix(arm) for arm in arms])])
