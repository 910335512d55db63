"""One valid state of the contacts: of many points by Newton's method (`cfem.contact.law.newton`) or by following them
along growing friction (`cfem.contact.law.path`); else by pivoting from a guess, then search.

Pivoting changes the mode of every violated point, or, where that leads back, of the worst alone; this nearly
always ends within a few systems, though nothing promises it (friction makes the problem neither symmetric nor
monotone). Then best first search over the modes, every choice for few points and up to a budget for more."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from heapq import heappop, heappush

import numpy as np

from cfem.contact.law.check import Check, check
from cfem.contact.law.modes import VALID, Mode, ModeSolution, modes_of, solve_mode, understood
from cfem.contact.law.newton import modes_from, newton
from cfem.contact.law.newton_object import newton_with_object
from cfem.contact.law.path import along_friction
from cfem.contact.law.problem import ContactProblem, Law

MOST = 4  # points of which a search may try every choice of modes
BUDGET = 400  # choices of modes that a search over more than four points tries
SEARCHED, FEW = 8, 20  # beyond so many points a search tries no more than FEW choices; so few, each from few starts
MANY = 30  # points on an object, beyond which nothing is tried but Newton's method: modes take seconds each
INDEFINITE = 1e-9  # of the largest eigenvalue of a compliance: how negative rounding may make the smallest
_PIVOTS = 12


class ContactStatus(Enum):
    """How a solve ended; the value is the sentence that the user reads."""

    SOLVED = "solved"
    NONE = "no choice of open, sticking and slipping contacts satisfies the law"
    UNSTABLE = "no state was found, and the robot is not stable where the contacts let go"
    BUDGET = "no state that satisfies the law was found among the choices tried"


@dataclass(frozen=True)
class LawfulState:
    """One state that obeys the law: forces lam (3m,) N, motion xi (k,) mm or rad, one mode a point, and its
    residuals."""

    lam: np.ndarray
    xi: np.ndarray
    modes: tuple[Mode, ...]
    check: Check


@dataclass(frozen=True)
class ContactSolution:
    """Answer of a solve. lam (3m,) N and xi (k,) mm or rad are NaN where there is no answer, then without modes too.

    tried: choices of modes that were solved"""

    lam: np.ndarray
    xi: np.ndarray
    modes: tuple[Mode, ...]
    check: Check
    status: ContactStatus
    tried: int


def solve_contact(
    problem: ContactProblem,
    law: Law,
    start_modes: Sequence[Mode] | None = None,
    budget: int = BUDGET,
    start: np.ndarray | None = None,
) -> ContactSolution:
    """State of contact that satisfies the law.

    start_modes: a guess, one a point; by default points within a gap are open and the others stick
    budget: of the search over more than four points
    start: a guess of the forces (3m,) N, for Newton's method on a problem with an object"""
    guess = start_modes or [Mode.OPEN if gap > 0 else Mode.STICK for gap in problem.free[::3]]
    tried = 0
    if problem.m > MOST and not problem.k and law != "bilateral":
        state, tried = _of_many(problem, law, start_modes)
        if state is not None:
            return _answer(problem, state, ContactStatus.SOLVED, tried)
        if _unstable(problem):
            return _answer(problem, None, ContactStatus.UNSTABLE, tried)
    if problem.m > MOST and problem.k and law == "coulomb" and problem.mu > 0:
        state, tried = _with_object(problem, start)
        if state is not None:
            return _answer(problem, state, ContactStatus.SOLVED, tried)
        if problem.m > MANY:
            return _answer(problem, None, ContactStatus.BUDGET, tried)
    state, more = _pivot(problem, law, understood(problem, law, guess))
    tried += more
    if state is not None:
        return _answer(problem, state, ContactStatus.SOLVED, tried)
    total = len(modes_of(problem, law)) ** problem.m
    limit = total if problem.m <= MOST else min(budget if problem.m <= SEARCHED else FEW, total)
    quick = problem.m > MOST and limit <= FEW
    state, searched = _search(problem, law, understood(problem, law, guess), limit, quick)
    if state is not None:
        return _answer(problem, state, ContactStatus.SOLVED, tried + searched)
    return _answer(problem, None, ContactStatus.NONE if searched == total else ContactStatus.BUDGET, tried + searched)


def _answer(problem: ContactProblem, state: LawfulState | None, status: ContactStatus, tried: int) -> ContactSolution:
    """Solution that reports the state and how the solve ended, NaN without a state."""
    if state is None:
        lam, xi = np.full(len(problem.free), np.nan), np.full(problem.k, np.nan)
        return ContactSolution(lam, xi, (), Check(*[float("nan")] * 6), status, tried)
    return ContactSolution(state.lam, state.xi, state.modes, state.check, status, tried)


def _state(problem: ContactProblem, law: Law, modes: tuple[Mode, ...], solution: ModeSolution) -> LawfulState:
    lam, xi = solution.lam[0], solution.xi[0]
    return LawfulState(lam, xi, modes, check(problem, law, lam, xi))


def _of_many(problem: ContactProblem, law: Law, start_modes: Sequence[Mode] | None) -> tuple[LawfulState | None, int]:
    """State of a problem without object: tries the modes that are given, Newton's method, then the path along growing
    friction."""
    tried = 0
    if start_modes:
        modes = understood(problem, law, start_modes)
        solution, tried = solve_mode(problem, law, modes, quick=True), 1
        if solution.valid:
            return _state(problem, law, modes, solution), tried
    mu = problem.mu if law == "coulomb" else 0.0
    force, systems = newton(problem.W, problem.free, mu)
    if force is None:
        force, more = along_friction(problem.W, problem.free, mu)
        systems += more
    if force is not None:
        lam, no_motion = force.ravel(), np.zeros(0)
        account = check(problem, law, lam, no_motion)
        if account.valid():
            return LawfulState(
                lam, no_motion, understood(problem, law, modes_from(force, mu)), account
            ), tried + systems
    return None, tried + systems


def _with_object(problem: ContactProblem, start: np.ndarray | None) -> tuple[LawfulState | None, int]:
    """Newton's method from the forces that are given, then from the smallest that balance the load."""
    p, u, tried, mu = problem.normalised, problem.units, 0, problem.mu
    for guess in ([] if start is None else [start / u.force]) + [None]:
        forces_and_motion = newton_with_object(p, mu, guess)
        tried += 1 if forces_and_motion is None else forces_and_motion[2]
        if forces_and_motion is not None:
            lam, xi = forces_and_motion[0].ravel() * u.force, forces_and_motion[1] * u.motion
            account = check(problem, "coulomb", lam, xi)
            if account.valid():
                return LawfulState(lam, xi, modes_from(forces_and_motion[0], mu), account), tried
    return None, tried


def _unstable(problem: ContactProblem) -> bool:
    lowest, *_, highest = np.linalg.eigvalsh(problem.W)
    return bool(lowest < -INDEFINITE * highest)


def _pivot(problem: ContactProblem, law: Law, modes: tuple[Mode, ...]) -> tuple[LawfulState | None, int]:
    """State reached by changing the modes of violated points, all at once, or the worst alone where that choice was
    tried."""
    seen: set[tuple[Mode, ...]] = set()
    for tried in range(1, _PIVOTS + 1):
        seen.add(modes)
        solution = solve_mode(problem, law, modes, quick=True)
        if solution.valid:
            return _state(problem, law, modes, solution), tried
        suggested = _others(problem, law, modes, solution)
        worst = np.argsort(-solution.violation[0]) if len(solution.violation) else np.arange(problem.m)
        proposals = [suggested] + [(*modes[:i], suggested[i], *modes[i + 1 :]) for i in worst]
        fresh = [choice for choice in proposals if choice not in seen]
        if not fresh:
            return None, tried
        modes = fresh[0]
    return None, _PIVOTS


def _others(problem: ContactProblem, law: Law, modes: tuple[Mode, ...], solution: ModeSolution) -> tuple[Mode, ...]:
    """The modes with every violated point's changed, to what its violation suggests."""
    if not len(solution.lam):  # undetermined or contradictory: let the object be held
        return understood(problem, law, [Mode.STICK] * problem.m)
    normal = solution.lam[0][::3]
    changed = list(modes)
    for i, mode in enumerate(modes):
        if solution.violation[0, i] <= VALID:
            continue
        if mode is Mode.OPEN:
            changed[i] = Mode.STICK
        elif normal[i] < 0:
            changed[i] = Mode.OPEN
        else:
            changed[i] = Mode.SLIP if mode is Mode.STICK else Mode.STICK
    return understood(problem, law, changed)


def _search(
    problem: ContactProblem, law: Law, start: tuple[Mode, ...], limit: int, quick: bool
) -> tuple[LawfulState | None, int]:
    """Best first: the neighbours of the least violated choice, its violated points' before the others'."""
    known = modes_of(problem, law)
    queue: list[tuple[float, int, tuple[Mode, ...]]] = [(0.0, 0, start)]
    queued, order, tried = {start}, 0, 0
    while queue and tried < limit:
        _, _, modes = heappop(queue)
        solution = solve_mode(problem, law, modes, quick=quick)
        tried += 1
        if solution.valid:
            return _state(problem, law, modes, solution), tried
        residual = float(solution.residual[0]) if len(solution.residual) else 1e3
        for i, mode in enumerate(modes):
            violated = not len(solution.violation) or solution.violation[0, i] > VALID
            for replacement in known:
                neighbour = (*modes[:i], replacement, *modes[i + 1 :])
                if replacement is not mode and neighbour not in queued:
                    queued.add(neighbour)
                    order += 1
                    heappush(queue, (residual if violated else 1e6 + residual, order, neighbour))
    return None, tried
