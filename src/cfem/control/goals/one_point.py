"""Goals that do not move: whatever follows them has tracked nothing."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from cfem.core.artefact.judgement import poor

_ONE_POINT = 1e-6  # of the robot's length


def one_point(goals: Mapping[str, np.ndarray], length: float) -> list[dict[str, Any]]:
    """Findings that make a run poor: trajectories of several goals that are all one point.

    goals: (m, n_e) mm of each trajectory
    length: mm of the robot"""
    return [
        poor(f"the {len(points)} goals of '{name}' are one point: nothing is tracked")
        for name, points in goals.items()
        if len(points) > 1 and np.ptp(points, axis=0).max() <= _ONE_POINT * length
    ]
