"""Goals that say nothing of the robot that reaches them."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from cfem.control.task.goals.trajectory_spec import ImageSpec, TrajectorySpec
from cfem.core.artefact.judgement import poor

_ONE_POINT = 1e-6  # of the robot's length
_WIDE = 0.05  # of the robot's length: how near to a goal tells something


def one_point(goals: Mapping[str, np.ndarray], length: float) -> list[dict[str, Any]]:
    """Findings that make a run poor: trajectories of several goals that are all one point.

    goals: (m, n_e) mm of each trajectory
    length: mm of the robot"""
    return [
        poor(f"the {len(points)} goals of '{name}' are one point: nothing is tracked")
        for name, points in goals.items()
        if len(points) > 1 and np.ptp(points, axis=0).max() <= _ONE_POINT * length
    ]


def left_out(goals: Mapping[str, np.ndarray], trajectories: Mapping[str, TrajectorySpec]) -> list[dict[str, Any]]:
    """Findings that make a run poor: images of which some have no stable state, so that fewer goals are tracked.

    goals: (m, n_e) mm of each trajectory"""
    findings = []
    for name, trajectory in trajectories.items():
        if isinstance(trajectory, ImageSpec) and len(goals[name]) < trajectory.goals:
            missing = trajectory.goals - len(goals[name])
            what = f"{missing} of {trajectory.goals} goals of '{name}' are left out"
            what += ", as the robot has no stable state there"
            findings.append(poor(f"{what}: lower its centre and radii, or the reach in scene.yaml"))
    return findings


def wide(near: float, length: float, key: str) -> list[dict[str, Any]]:
    """Findings that make a run poor: goals that are reached from so far away that this says little.

    near: mm from a goal, within which it counts as reached
    length: mm of the robot
    key: of the spec that states `near`"""
    if near <= _WIDE * length:
        return []
    what = f"a goal counts as reached from {near:.4g} mm away, and the robot is {length:.4g} mm long"
    return [poor(f"{what}: lower {key}")]
