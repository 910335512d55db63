"""How far each actuator of a robot goes, found by solving: until the body is strained or bent to a limit, or a solve
fails, as where it buckles."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from cfem.equilibrium.actuation import Actuation, pull
from cfem.equilibrium.evaluation import Evaluation
from cfem.equilibrium.fields import Strain
from cfem.equilibrium.newton import Settings
from cfem.equilibrium.problem import Problem
from cfem.equilibrium.robot import Robot
from cfem.equilibrium.solution import Equilibrium, Status
from cfem.equilibrium.solve import solve

STRAIN = 0.5  # largest principal stretch less one, as a mean of high power over the body
BEND = np.pi / 2  # rad by which the tip turns
_POWER = 8.0
_FIRST = {"mm": 0.01, "mm^3": 0.02}  # of the length of a cable, of the volume of a chamber
_MOST = {"mm": 0.35, "mm^3": 3.0}
_GROWTH = 1.7
_TIP = 0.1  # of the robot's length: nodes so near to the watched point turn with it
_ALL = (1.0, 0.7, 0.5, 0.35)  # shares of the strokes tried where all actuators go together
_LOOSE = Settings(tolerance=1e-6)


@dataclass(frozen=True)
class Stroke:
    """reach: mm (mm^3 of a chamber); force: N (MPa) there; why: what says stop, in words."""

    reach: float
    force: float
    why: str


def strokes(robot: Robot, advance: Callable[[int], None] = lambda _: None) -> list[Stroke]:
    """Of each actuator alone, the others without force; made smaller together where not all can go so far at once.
    advance: called after each solve."""
    problem = Problem(robot)
    near = np.linalg.norm(robot.X - robot.rest_e[:3], axis=1)
    tip = near.argsort()[: max(8, int((near < _TIP * robot.length).sum()))]
    found = [_alone(problem, index, tip, advance) for index in range(robot.rows.n_a)]
    if len(found) < 2:
        return found
    reach = np.array([each.reach for each in found])
    for share in _ALL:
        ended = solve(problem, pull(np.ones(len(reach)), share * reach), settings=_LOOSE, condense=False)
        advance(1)
        if ended.status is Status.CONVERGED:
            break
    if share == 1.0:
        return found
    why = "; less, as all actuators cannot go so far at once"
    return [Stroke(share * each.reach, share * each.force, each.why + why) for each in found]


def _alone(problem: Problem, index: int, tip: np.ndarray, advance: Callable[[int], None]) -> Stroke:
    robot = problem.robot
    row, unit = robot.actuators[index], robot.actuator_units[index][0]
    whole = getattr(row, "rest_volume", None) or getattr(row, "rest_length", None) or robot.length
    C = np.eye(robot.rows.n_a)[[index]]
    amount, most = _FIRST[unit] * whole, _MOST[unit] * whole
    done, force, before, state = 0.0, 0.0, 0.0, None
    while True:
        target = Actuation(C, np.array([amount]), np.zeros(robot.rows.n_a))
        ended = solve(problem, target, state, state, _LOOSE, condense=False, slack=False)
        advance(1)
        if ended.status is not Status.CONVERGED:
            if done == 0.0 and amount > 1e-3 * _FIRST[unit] * whole:
                amount /= 4
                continue
            return Stroke(0.8 * (done or amount), 0.8 * force, f"beyond it, {_short(ended.status)}")
        used, why = _used(problem, ended, tip)
        here = float(abs(ended.state.lam[index]))
        if used >= 1.0:
            share = (1.0 - before) / (used - before)
            return Stroke(done + share * (amount - done), force + share * (here - force), why)
        done, force, before, state = amount, here, used, ended.state
        if amount >= most:
            return Stroke(most, force, f"{100 * _MOST[unit]:.0f} % of its {'volume' if unit == 'mm^3' else 'length'}")
        amount = min(most, amount * min(_GROWTH, max(1.15, 1.05 / max(used, 1e-3))))


def _used(problem: Problem, ended: Equilibrium, tip: np.ndarray) -> tuple[float, str]:
    """The largest share of a limit that a state has come to, and which."""
    strain = _strain(problem, problem.evaluate(ended.state.x, ended.state.pressure, ended.state.load))
    X, x = problem.robot.X[tip], ended.state.x[tip]
    turn = Rotation.align_vectors(x - x.mean(axis=0), X - X.mean(axis=0))[0].magnitude()
    shares = {f"strained by {100 * STRAIN:.0f} %": strain / STRAIN}
    shares[f"turns the tip by {np.degrees(BEND):.0f} degrees"] = turn / BEND
    why = max(shares, key=shares.get)
    return shares[why], why


def _strain(problem: Problem, at: Evaluation) -> float:
    return Strain(_POWER).value(problem, at)


def _short(status: Status) -> str:
    """The first words of what a person reads about a status."""
    return status.value.partition(":")[0]
