"""Equilibria of robots whose contact points meet rigid bodies: they open, touch, stick and slide.

Every robot is solved by finite elements with its contact points held at trial positions; condensation gives what they
yield to contact forces, exactly to first order; the contact law on that linearisation, with the motion and the balance
of what the points meet, is solved exactly (`cfem.contact.law.solve`); its displacements are the next trial positions
and poses. It is Newton's method on the nonlinear problem but for the curvature of the surfaces; the last state is
checked as it is, not as the linearisation has it: gaps, forces, cones and the balance of what moves by itself. A
learned robot takes the place of finite elements where it answers the same (`PointRobot`)."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

import numpy as np
from scipy.linalg import block_diag

from cfem.contact.law.check import Check, check
from cfem.contact.law.modes import Mode
from cfem.contact.law.problem import Law
from cfem.contact.law.sliding import FOLLOWED
from cfem.contact.law.solve import FEW, ContactSolution, ContactStatus, solve_contact
from cfem.contact.step_status import StepStatus
from cfem.equilibrium.contact.held_patch import contact_points, held
from cfem.equilibrium.contact.posed import Partner, Posed, StepOrigin, posed_contact
from cfem.equilibrium.newton import NewtonSettings
from cfem.equilibrium.solve import Wanted, solve
from cfem.equilibrium.system.actuation import Actuation
from cfem.equilibrium.system.evaluation import Tangent
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.solution import Equilibrium

EXACT, ROUGH = 1e-11, 1e-5  # relative residuals of a robot: of the last state, and far from it
NEARLY = 1e-4  # of law and balance: from here on robots are solved exactly
CONDENSED = 1e-2  # of A^-1 H^T: W, which has the square of it, only serves Newton's method
ALIKE = 2e-3  # of the robot's length: where rows have moved by less, the points yield alike
QUICK, BUCKLES = 0.1, 0.99  # ratios of a correction to the one before: below and above, it is taken as it is
STAYED = 1e-5  # mm: a robot whose points are this far from where they are held did not come there


class PointRobot(Protocol):
    """A robot with k contact points; turn (3, 3): from its frame to the scene's."""

    turn: np.ndarray

    @property
    def points(self) -> np.ndarray:
        """Contact points (k, 3) mm at rest, in the scene."""
        ...

    def respond(
        self, actuators: Actuation, delta_c: np.ndarray, before: Any, tolerance: float = EXACT
    ) -> tuple[Any, np.ndarray]:
        """State with the contact points held at delta_c (3k,) mm from rest, in its frame, or nearby, like `Equilibrium`
        (delta_c: where they are, lambda_c, delta_a, lambda_a, converged, factorizations), and the compliance (3k, 3k)
        mm/N of the points. before: the last such state, None at first; tolerance: of its residual, relative."""
        ...


@runtime_checkable
class ForcePointRobot(Protocol):
    """A robot that is solved under given forces on its contact points, and not with these held: points near each other
    hardly move by themselves, so that places which are not quite those of a state take large forces."""

    turn: np.ndarray

    @property
    def points(self) -> np.ndarray:
        """Contact points (k, 3) mm at rest, in the scene."""
        ...

    def under(self, actuators: Actuation, forces: np.ndarray, before: Any, tolerance: float) -> tuple[Any, np.ndarray]:
        """State under forces (3k,) N on the points, in its frame, as `PointRobot.respond` has it."""
        ...


def response(
    robot: PointRobot | ForcePointRobot,
    actuators: Actuation,
    delta_c: np.ndarray,
    forces: np.ndarray,
    before: Any = None,
    tolerance: float = EXACT,
) -> tuple[Any, np.ndarray]:
    """State of a robot with its points held at delta_c (3k,) mm, or under forces (3k,) N on them, as it is solved, and
    their compliance (3k, 3k) mm/N: see `PointRobot`."""
    if isinstance(robot, ForcePointRobot):
        return robot.under(actuators, forces, before, tolerance)
    return robot.respond(actuators, delta_c, before, tolerance)


@dataclass
class _Known:
    """Knowledge of the latest states of a robot.

    tangent: the factor
    yielding: (n_c, n_c) mm/N, compliance of its points in the state that was `asked` for
    slack: (n_a,) actuators that carried nothing there"""

    tangent: Tangent | None = None
    yielding: np.ndarray | None = None
    asked: Actuation | None = None
    slack: np.ndarray | None = None

    def near(self, asked: Actuation, n_a: int, length: float) -> bool:
        """True where the points would yield alike, the same of the n_a actuators slack."""
        if self.yielding is None or len(asked.target) != len(self.asked.target):
            return False
        moved = np.abs(asked.target - self.asked.target).max(initial=0.0)
        return bool(moved <= ALIKE * length and np.array_equal(asked.offset[:n_a], self.asked.offset[:n_a]))


@dataclass(frozen=True)
class PlacedRobot:
    """One FE robot; turn (3, 3) and shift (3,) mm from its frame to the scene's. It is quick where its problem is its
    own: the factor of one state then serves the next as well."""

    problem: Problem
    turn: np.ndarray
    shift: np.ndarray
    _known: _Known = field(default_factory=_Known, repr=False, compare=False)

    @property
    def points(self) -> np.ndarray:
        """Contact points (k, 3) mm at rest, in the scene."""
        return contact_points(self.problem) @ self.turn.T + self.shift

    def forget(self) -> None:
        """Drops what it knows of the latest states: the next one then depends on the state before it alone."""
        self._known.tangent = self._known.yielding = None

    def respond(
        self, actuators: Actuation, delta_c: np.ndarray, before: Equilibrium | None, tolerance: float = EXACT
    ) -> tuple[Equilibrium, np.ndarray]:
        """State and compliance of the points (`PointRobot.respond`)."""
        return self.solved(actuators, held(actuators, delta_c), before, tolerance)

    def solved(
        self, actuators: Actuation, asked: Actuation, before: Equilibrium | None, tolerance: float
    ) -> tuple[Equilibrium, np.ndarray]:
        """State of actuators and points as `asked`, and the compliance of the points with the `actuators` driven. The
        compliance of the last state serves again where the actuation is near it and the same cables are slack."""
        problem, known, free = self.problem, self._known, actuators.n
        start = None if before is None else before.state
        tangent = known.tangent if known.tangent is problem.latest else None
        near = start is not None and known.near(asked, free, problem.robot.length)
        settings = NewtonSettings(tolerance=tolerance, condensed=CONDENSED)
        equilibrium = solve(problem, asked, start, start, settings, tangent=tangent, wanted=Wanted(condense=not near))
        if near and equilibrium.converged and (equilibrium.slack != known.slack).any():
            near, start = False, equilibrium.state
            equilibrium = solve(problem, asked, start, start, settings, tangent=problem.latest)
        if not equilibrium.converged:
            return equilibrium, np.zeros((0, 0))
        if not near:
            known.yielding, known.asked, known.slack = (
                point_compliance(equilibrium, actuators),
                asked,
                equilibrium.slack,
            )
        known.tangent = problem.latest
        return equilibrium, known.yielding


@dataclass(frozen=True)
class PointsState:
    """One state of robots and their partner.

    solved: of each robot, with multipliers of its contact points in its own frame (N), None where it was not solved
    modes: of all points, robot after robot
    around: what they meet, where it is
    stuck: (m, 3) mm, the places on it where the points stick or would
    check: of law and balance at the state itself
    iterations: rounds of FE solves
    factorizations: of them all
    posed: the contact problem there, None before any"""

    status: StepStatus
    solved: tuple[Equilibrium | None, ...]
    modes: tuple[Mode, ...]
    around: Partner
    stuck: np.ndarray
    check: Check | None
    iterations: int
    factorizations: int
    posed: "Posed | None" = None

    @property
    def converged(self) -> bool:
        return self.status is StepStatus.CONVERGED


def points_step(
    robots: Sequence[PointRobot | ForcePointRobot],
    actuators: Sequence[Actuation],
    around: Partner,
    before: PointsState | None = None,
    law: Law = "coulomb",
    mu: float = 0.0,
    tolerance: float = 1e-9,
    iterations: int = 40,
) -> PointsState:
    """Quasi-static step of the robots to `actuators`, one for each, from the state `before` (none: at rest, every point
    that touches sticks where it is). Friction is followed along the step. tolerance: of law and balance, relative, at
    the state itself. Never raises for numerical failure."""
    points = np.concatenate([robot.points for robot in robots])
    turns = block_diag(*[np.kron(np.eye(len(robot.points)), robot.turn) for robot in robots])
    ends = np.cumsum([0, *(3 * len(robot.points) for robot in robots)])
    solved: list[Any] = [None] * len(robots) if before is None else list(before.solved)
    moved, push = _at_begin(robots, turns, solved)
    places, modes = points + moved, () if before is None else before.modes
    stuck = around.places(points) if before is None else before.stuck
    origin, slip = StepOrigin(around if before is None else before.around, places, push), np.zeros((len(points), 2))
    verdict, posed, cost, last = None, None, 0, None

    def ended(status: StepStatus, count: int) -> PointsState:
        return PointsState(status, tuple(solved), modes, around, stuck, verdict, count, cost, posed)

    for iteration in range(1, iterations + 1):
        moved, pushed, soft = turns.T @ (places - points).ravel(), turns.T @ push, []
        asked = EXACT if verdict is not None and verdict.largest < NEARLY else ROUGH
        for i, (robot, actuation) in enumerate(zip(robots, actuators, strict=True)):
            points_of = slice(*ends[i : i + 2])
            solved[i], yielding = response(robot, actuation, moved[points_of], pushed[points_of], solved[i], asked)
            soft.append(yielding)
        cost += sum(state.factorizations for state in solved)
        if not all(state.converged for state in solved):
            return ended(StepStatus.NO_EQUILIBRIUM, iteration)
        came = points + (turns @ np.concatenate([state.delta_c for state in solved])).reshape(-1, 3)
        seen_from = places if iteration == 1 else came
        places = came if np.abs(came - places).max() > STAYED else places
        compliance = turns @ block_diag(*soft) @ turns.T
        push = turns @ np.concatenate([state.lambda_c for state in solved])
        whole = posed_contact(around, places, seen_from, stuck, compliance, push, law, mu)
        if law == "coulomb" and mu and iteration <= FOLLOWED:
            slip = origin.slid(whole, around, stuck)
        posed = whole.after(slip)
        verdict = check(posed.problem, law, posed.force, np.zeros(posed.problem.k))
        if verdict.largest <= tolerance and modes and asked == EXACT:
            stuck = _stuck_next(around, places, stuck, posed.slid, modes)
            return ended(StepStatus.CONVERGED, iteration)
        posed, slip, answer = _answered(whole, slip, law, modes)
        if answer.status is not ContactStatus.SOLVED:
            return ended(StepStatus.NO_MODE, iteration)
        change, xi = posed.rotation.T @ (answer.lam - posed.force), posed.motion(answer)
        goes = compliance @ change
        correction = np.concatenate([goes, around.motion(places) @ xi])
        share = _share(last, correction) if answer.modes == modes else 1.0
        last = correction if share == 1.0 else None
        modes, around = answer.modes, around.moved(share * xi)
        places, push = places + share * goes.reshape(-1, 3), push + share * change
    return ended(StepStatus.ITERATIONS, iterations)


def _answered(
    whole: Posed, slip: np.ndarray, law: Law, modes: Sequence[Mode]
) -> tuple[Posed, np.ndarray, ContactSolution]:
    """Contact problem, slip (m, 2) mm before, and answer of the last part of a step; of the `whole` step, none having
    slipped before, where its last part has no state."""
    posed = whole.after(slip)
    answer = solve_contact(posed.problem, law, modes or None, budget=FEW, start=posed.force)
    if answer.status is ContactStatus.SOLVED or not slip.any():
        return posed, slip, answer
    return whole, np.zeros_like(slip), solve_contact(whole.problem, law, modes or None, budget=FEW, start=whole.force)


def _stuck_next(
    around: Partner, places: np.ndarray, stuck: np.ndarray, slid: np.ndarray, modes: Sequence[Mode]
) -> np.ndarray:
    """Places (m, 3) mm on the partner where points at places (m, 3) mm stick in the next step, or would: those that
    stick stay where they have slid to, (m, 3) mm, before the last part of this one."""
    sticks = np.array([mode is Mode.STICK for mode in modes])[:, None]
    held = around.places(around.now(stuck) + slid) if slid.any() else stuck
    return np.where(sticks, held, around.places(places))


def _share(last: np.ndarray | None, correction: np.ndarray) -> float:
    """Factor for the correction (n,) mm after one, `last`, that was taken as it was. The linearisation leaves out that
    arms and weights turn with what moves. Corrections may so shrink slowly, all along one direction: this is the sum of
    their series (Aitken). It has a sum beyond a ratio of -1 too, where the robot is stiffer than its linearisation. At
    a ratio of 1 the state is unstable, and is not to be found."""
    if last is None:
        return 1.0
    ratio = float(last @ correction) / float(last @ last)
    return 1 / (1 - ratio) if abs(ratio) > QUICK and ratio < BUCKLES else 1.0


def _at_begin(robots: Sequence[Any], turns: np.ndarray, solved: Sequence[Any]) -> tuple[np.ndarray, np.ndarray]:
    """Displacements (m, 3) mm of the points and forces (3m,) N on them, in the scene's axes, in the states in which the
    step begins, None: at rest."""
    none = [np.zeros(3 * len(robot.points)) for robot in robots]
    each = list(zip(none, solved, strict=True))
    moved = np.concatenate([zero if state is None else state.delta_c for zero, state in each])
    return (turns @ moved).reshape(-1, 3), turns @ np.concatenate([z if s is None else s.lambda_c for z, s in each])


def point_compliance(solved: Equilibrium, actuators: Actuation) -> np.ndarray:
    """Compliance (n_c, n_c) mm/N of the contact rows to their forces, the actuators as they are driven, slack ones
    free."""
    condensed, rows = solved.condensed, solved.condensed.rows
    C = actuators.C[(actuators.C[:, ~solved.slack] != 0).any(axis=1)]
    W_ac = C @ condensed.W[rows.a, rows.c]
    W_aa = C @ condensed.W[rows.a, rows.a] @ C.T
    return condensed.W[rows.c, rows.c] - W_ac.T @ np.linalg.solve(W_aa, W_ac)
