"""References of a loop: goals one after the other, and when the next one is due."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from cfem.control.closed_loop.run import Pace
from cfem.control.closed_loop.spec import LoopSpec
from cfem.control.task.goals.trajectory import laps


@dataclass(frozen=True)
class Reference:
    """Trajectory to follow.

    name: in the results
    goals: (m, n_e) mm absolute
    pace: when the next goal is due"""

    name: str
    goals: np.ndarray
    pace: Pace


def references_of(goals: Mapping[str, np.ndarray], loop: LoopSpec) -> list[Reference]:
    """The trajectories, or with laps each of them at each speed."""
    if loop.laps is None:
        return [Reference(name, points, _pace(loop, 0)) for name, points in goals.items()]
    references = []
    for name, points in goals.items():
        for speed in loop.laps.speeds:
            lap, run_up = laps(points, speed, loop.laps.laps, loop.laps.run_up, 1 / loop.rate)
            references.append(Reference(f"{name} at {speed:g} Hz", lap, _pace(loop, run_up)))
    return references


def _pace(loop: LoopSpec, run_up: int) -> Pace:
    """When goals are due; run_up: goals that do not count."""
    if loop.laps:
        return Pace(loop.settle.radius, 1, 1, run_up=run_up)
    return Pace(
        loop.settle.radius,
        loop.ticks(loop.settle.hold),
        None if loop.goal_every is None else loop.ticks(loop.goal_every),
        loop.ticks(loop.settle.at_most),
        None if loop.budget is None else loop.ticks(loop.budget),
        0 if loop.goal_every is None else loop.ticks(loop.approach),
    )
