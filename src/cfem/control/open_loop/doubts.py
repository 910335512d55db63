"""Reasons not to trust a tracking result, beside how near it came to its goals."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from cfem.control.task.goals.doubts import one_point, wide
from cfem.core.artefact.judgement import UNCERTAIN, poor

QUANTITIES = {"the actuator forces": "force_percent", "the effectors' travel": "travel_percent"}


def doubts(
    goals: Mapping[str, np.ndarray], near: float, refined: Mapping[str, Any], length: float
) -> list[dict[str, Any]]:
    """Findings about goals and mesh that leave the results in doubt.

    goals: (m, n_e) mm of each trajectory
    near: mm from a goal where it counts as reached
    refined: of `mesh_error.discretisation`
    length: mm of the robot"""
    findings = [*one_point(goals, length), *wide(near, length, "reached")]
    uncertain = {quantity: refined.get(key, 0.0) / 100 for quantity, key in QUANTITIES.items()}
    what = " and ".join(f"{100 * share:.2g} % of {name}" for name, share in uncertain.items() if not share <= UNCERTAIN)
    if what:
        findings.append(poor(f"the mesh of {refined['cells']} cells leaves {what} uncertain: use a finer mesh"))
    if "apart_percent" in refined:
        findings.append(poor(f"{refined['left_out']}: use a finer mesh"))
    return findings
