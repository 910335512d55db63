"""Equilibrium with friction between cables and their guides.

A cable that slips all along loses tension as on a capstan, T(s) = T0 exp(-way mu theta(s)), theta the angle that it
has turned up to s (Euler 1769): way 1 while it is pulled in, -1 while it is let out, and the difference is the
hysteresis of loading and unloading. Between the two the cable sticks, and where the robot rests depends on its past
(sticking.py). The shares T / T0 are found with the shape, in turns; with the shares held the cable has a potential."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cfem.constraint.cable import Cable
from cfem.constraint.rod_cable import RodCable
from cfem.equilibrium.solve import Wanted, solve
from cfem.equilibrium.system.actuation import Actuation
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.robot import Robot
from cfem.equilibrium.system.solution import Equilibrium, State, Status

_TURNS = 60
_ENOUGH = 1e-7  # change of any share
Shares = tuple[np.ndarray | None, ...]


def has_friction(robot: Robot) -> bool:
    """True where any cable has friction."""
    return any(getattr(actuator, "friction", 0.0) > 0 for actuator in robot.actuators)


def solve_slipping(
    problem: Problem,
    actuation: Actuation,
    start: State | None = None,
    shares: Shares | None = None,
    ways: Sequence[float] | float = 1.0,
) -> tuple[Equilibrium, Shares]:
    """An equilibrium in which every cable that has friction slips its way, without its W; shares: of a state nearby, to
    start from. Status INACCURATE where shape and shares do not settle."""
    robot = problem.robot
    if not has_friction(robot):
        return solve(problem, actuation, start, wanted=Wanted(condense=False)), _own(robot)
    ways = np.broadcast_to(ways, len(robot.actuators))
    now = shares or _own(robot)
    weight, last = 1.0, None
    for _ in range(_TURNS):
        held = Problem(replace(robot, actuators=_with(robot, now)), like=problem)
        equilibrium = solve(held, actuation, start, wanted=Wanted(condense=False))
        if equilibrium.status is not Status.CONVERGED:
            return equilibrium, now
        start, wanted = equilibrium.state, _slipping(robot, equilibrium.state.x, ways, now)
        lacks = np.concatenate([b - a for a, b in zip(now, wanted, strict=True) if a is not None])
        if np.abs(lacks).max() <= _ENOUGH:
            return equilibrium, now
        # Aitken's relaxation of a vector iteration (Irons and Tuck, IJNME 1, 1969)
        if last is not None and np.any(lacks != last):
            weight = float(np.clip(-weight * last @ (lacks - last) / np.sum((lacks - last) ** 2), 0.1, 2.0))
        last = lacks
        now = tuple(a if a is None else a + weight * (b - a) for a, b in zip(now, wanted, strict=True))
    return replace(equilibrium, status=Status.INACCURATE), now


def slipping(cable: Cable | RodCable, x: np.ndarray, direction: float) -> np.ndarray:
    """Shares (s,) of the tension where the cable slips in all its guides, nodes at x (n, 3) mm."""
    return np.exp(-direction * cable.friction * np.cumsum(cable.turned(x)))


def _own(robot: Robot) -> Shares:
    """Shares of the robot's cables, None of other actuators."""
    return tuple(getattr(actuator, "shares", None) for actuator in robot.actuators)


def _with(robot: Robot, shares: Shares) -> tuple:
    """The actuators with these shares held."""
    return tuple(
        actuator if share is None else replace(actuator, shares=share, friction=0.0)
        for actuator, share in zip(robot.actuators, shares, strict=True)
    )


def _slipping(robot: Robot, x: np.ndarray, ways: np.ndarray, before: Shares) -> Shares:
    return tuple(
        None if share is None else slipping(actuator, x, direction)
        for actuator, direction, share in zip(robot.actuators, ways, before, strict=True)
    )
