"""Motion over the actuators' reach if a robot's equations were linear: from the compliance at rest.

An actuator that alone acts on a linear body moves it by u = A^-1 H^T lambda, with lambda = reach / (H A^-1 H^T), or
with its pressure for lambda. A cable that bends a body into a full circle moves its end by pi times its length in this
measure, and the robots of the catalogue move by 0.1 to 2.4 times their size."""

from collections.abc import Iterator

import numpy as np

from cfem.core.errors import CfemError
from cfem.equilibrium.system.evaluation import SolveCost
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.robot import Robot

LEAST, MOST = 0.003, 8.0  # times the robot's size, that a full reach may move it by


def linear_motion(robot: Robot) -> tuple[np.ndarray, np.ndarray]:
    """Motion (n_a,) mm of the node that moves most, by a unit displacement of each actuator, and by a unit force (mm/N,
    mm/MPa). Raises SingularMatrixError where nothing holds the robot."""
    problem = Problem(robot)
    state = problem.evaluate(problem.rest, np.empty(0))
    H = state.H[:, : robot.rows.n_a]
    Z = problem.factor(state, np.zeros(problem.n_active), SolveCost()).factor.solve(H)
    compliance = np.einsum("ij,ij->j", H, Z)
    fields = [problem.kinematics.spread(state.x, column) for column in Z.T]
    by_force = np.array([np.linalg.norm(field, axis=1).max() for field in fields])
    return by_force / compliance, by_force


def stroke_doubts(scene, robot: Robot) -> list[str]:
    """A sentence for each reach, or range of pressure, that moves next to nothing, or more than a body survives."""
    if not robot.rows.n_a:
        return []
    try:
        motions = linear_motion(robot)
    except CfemError:
        return []  # whoever solves says why
    size = float(np.ptp(robot.X, axis=0).max())
    return [
        sentence
        for index, (item, actuator) in enumerate(zip(scene.actuators, robot.actuators, strict=True))
        for what, most, unit, motion in _ranges(item, actuator.units[0], *(of_all[index] for of_all in motions))
        if (sentence := _doubt(f"{what} of {item.kind} '{item.name}'", f"{most:.4g} {unit}", motion, size))
    ]


def _ranges(item, unit: str, by_displacement: float, by_force: float) -> Iterator[tuple[str, float, str, float]]:
    """Limits of an actuator by its keys: what it is, its largest size, its unit, and the mm by which that moves the
    body."""
    most = float(np.abs(item.reach).max())
    yield "the reach", most, unit, most * by_displacement
    if getattr(item, "pressure", None) is not None:
        most = float(np.abs(item.pressure).max())
        yield "the pressure", most, "MPa", most * by_force


def _doubt(what: str, end: str, motion: float, size: float) -> str:
    """Sentence if a full range moves next to nothing, or more than a body survives; else empty."""
    if motion < LEAST * size:
        return f"{what} ends at {end}, which moves the body by {motion:.2g} mm of its {size:.3g} mm: check its unit"
    if motion > MOST * size:
        how = f"would move a linear body by {motion / size:.2g} times its size, and none survives more than {MOST:g}"
        return f"{what} ends at {end}, which {how}: check its unit, and that of Young's modulus"
    return ""
