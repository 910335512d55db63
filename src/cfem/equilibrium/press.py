"""Equilibria of a robot whose contact points meet moving rigid obstacles: they open, touch, stick and slide.

The FE robot is solved with its contact points held at trial positions; condensation gives what they yield to contact
forces, exactly to first order; the contact law on that linearisation is solved exactly (`cfem.contact.solve`), and its
displacements are the next trial positions. It is Newton's method on the nonlinear problem but for the curvature of the
obstacle's surface; the last state is checked as it is, not as the linearisation has it."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from scipy.linalg import block_diag

from cfem.contact.check import Check, check
from cfem.contact.modes import Mode
from cfem.contact.obstacle import Obstacle
from cfem.contact.problem import ContactProblem, Law
from cfem.contact.solve import ContactStatus, solve_contact
from cfem.equilibrium.actuation import Actuation
from cfem.equilibrium.held_patch import held
from cfem.equilibrium.newton import Settings
from cfem.equilibrium.problem import Problem
from cfem.equilibrium.solution import Equilibrium, State
from cfem.equilibrium.solve import solve


class PressStatus(Enum):
    """How it ended; the value is the sentence that the user reads."""

    CONVERGED = "converged"
    NO_MODE = "no combination of open, sticking and sliding points is in equilibrium"
    ITERATIONS = "open, sticking and sliding points keep changing: the iterations allowed were used up"
    NO_EQUILIBRIUM = "the robot finds no equilibrium with its contact points held"


@dataclass(frozen=True)
class Press:
    """One state. solved: of the robot, with multipliers of the contact rows (N); modes: of each point; stuck: (k, 3) mm
    where each point sticks, or would, in the scene; check: of the contact law at the state itself; iterations: FE
    solves; factorizations: of them all."""

    status: PressStatus
    solved: Equilibrium
    modes: tuple[Mode, ...]
    stuck: np.ndarray
    check: Check | None
    iterations: int
    factorizations: int

    @property
    def converged(self) -> bool:
        return self.status is PressStatus.CONVERGED


def press(
    problem: Problem,
    actuators: Actuation,
    obstacles: Sequence[Obstacle],
    law: Law = "coulomb",
    mu: float = 0.0,
    before: Press | None = None,
    carried: np.ndarray | None = None,
    cone: str = "exact",
    tolerance: float = 1e-8,
    iterations: int = 30,
) -> Press:
    """Quasi-static step to `actuators`, one obstacle a contact point, from the state `before` (none: nothing touches).

    carried: (k, 3) mm where the points at which friction held before are now, as the obstacles have moved with them
    (where they were unless given). tolerance: of the law, relative, at the state itself. Never raises for numerical
    failure."""
    points = np.array([point.rest for point in problem.robot.contacts])
    k, cost = len(points), 0
    settings = Settings(tolerance=1e-11)
    state: State | None = None if before is None else before.solved.state
    begun = solve(problem, actuators, base=state, settings=settings) if before is None else None
    if begun is not None:
        cost += begun.factorizations
        if not begun.converged:
            return Press(PressStatus.NO_EQUILIBRIUM, begun, (), points, None, 1, cost)
        delta, state = begun.delta_c, begun.state
        stuck = points + delta.reshape(k, 3)
    else:
        delta = before.solved.delta_c
        stuck = before.stuck if carried is None else carried
    modes, solved = () if before is None else before.modes, begun or before.solved
    for iteration in range(iterations):
        solved = solve(problem, held(actuators, delta), start=state, base=state, settings=settings)
        cost += solved.factorizations
        if not solved.converged:
            return Press(PressStatus.NO_EQUILIBRIUM, solved, modes, stuck, None, iteration + 1, cost)
        state = solved.state
        at = points + delta.reshape(k, 3)
        frames = np.concatenate([one.frames(x[None]) for one, x in zip(obstacles, at, strict=True)])
        gap = np.einsum("kij,kj->ki", frames, at - stuck)
        gap[:, 0] = [float(one.distance(x[None])[0]) for one, x in zip(obstacles, at, strict=True)]
        turn = block_diag(*frames)
        compliance = yields(solved, actuators)
        W = turn @ compliance @ turn.T
        force = turn @ solved.lambda_c
        posed = ContactProblem((W + W.T) / 2, gap.ravel() - W @ force, mu=mu, cone=cone)
        verdict = check(posed, law, force)
        if verdict.largest <= tolerance and modes:
            moved = np.where(np.array([m is Mode.STICK for m in modes])[:, None], stuck, at)
            return Press(PressStatus.CONVERGED, solved, modes, moved, verdict, iteration + 1, cost)
        answer = solve_contact(posed, law, modes or None)
        if answer.status not in (ContactStatus.SOLVED, ContactStatus.SEVERAL):
            return Press(PressStatus.NO_MODE, solved, modes, stuck, verdict, iteration + 1, cost)
        modes = answer.modes
        delta = delta + compliance @ turn.T @ (answer.lam - force)
    return Press(PressStatus.ITERATIONS, solved, modes, stuck, verdict, iterations, cost)


def yields(solved: Equilibrium, actuators: Actuation) -> np.ndarray:
    """(n_c, n_c) mm/N: of the contact rows to their forces, the actuators as they are driven, slack ones free."""
    condensed, rows = solved.condensed, solved.condensed.rows
    C = actuators.C[(actuators.C[:, ~solved.slack] != 0).any(axis=1)]
    W_ac = C @ condensed.W[rows.a, rows.c]
    W_aa = C @ condensed.W[rows.a, rows.a] @ C.T
    return condensed.W[rows.c, rows.c] - W_ac.T @ np.linalg.solve(W_aa, W_ac)
