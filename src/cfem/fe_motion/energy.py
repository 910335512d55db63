"""Energy of a motion: kinetic, elastic less the work of constant loads, taken by viscosity, given by actuators."""

from dataclasses import dataclass

import numpy as np

from cfem.equilibrium.system.evaluation import Evaluation
from cfem.fe_motion.problem import MovingEvaluation, MovingProblem
from cfem.fe_motion.scheme import Motion
from cfem.mechanics import viscosity as viscous


@dataclass(frozen=True)
class Energy:
    """Energy of a motion, N mm. kinetic + potential + viscous - actuators is constant but for the scheme's own
    dissipation.

    viscous: taken by the overstress since the start, of which Prony terms hold a part
    actuators: work done by the active rows since the start"""

    kinetic: float
    potential: float
    viscous: float = 0.0
    actuators: float = 0.0

    @property
    def balance(self) -> float:
        return self.kinetic + self.potential + self.viscous - self.actuators


def at_start(problem: MovingProblem, motion: Motion) -> Energy:
    evaluation = problem.evaluate(motion.x, np.empty(0))
    return Energy(kinetic(problem, motion.v), problem.potential(evaluation))


def kinetic(problem: MovingProblem, v: np.ndarray) -> float:
    """Kinetic energy N mm of velocities (n, 3) mm/s."""
    return float(np.sum(v * (problem.mass @ v)) / 2)


def viscous_power(problem: MovingProblem, evaluation: Evaluation, v: np.ndarray) -> float:
    """Power, N mm/s, that the overstress of the step takes at its end, at velocities v (n, 3)."""
    over = problem.step.overstress if problem.step else None
    if over is None or not isinstance(evaluation, MovingEvaluation):
        return 0.0
    power = float(np.sum(v * viscous.solid_force(problem.body, evaluation.response, over)))
    if evaluation.response.rod is not None:
        sections = problem.body.sections
        # motions of both sections in the rod's unknowns: centre, and rotation times radius of gyration
        power += float(
            (viscous.rod_stress(problem.body, evaluation.response, over) * _strain_rate(evaluation, v, sections)).sum()
        )
    return power


def _strain_rate(evaluation: Evaluation, v: np.ndarray, sections) -> np.ndarray:
    """Strain rates de/dt (m, 6) of the rod's elements."""
    _, R = sections.frames(evaluation.x)
    centre, across = v[sections.nodes].mean(axis=1), sections.across @ v[sections.nodes]  # (s, 3), (s, 2, 3)
    # dR/dt R^T of a rigid section: omega = 1/2 sum_k d_k x dd_k/dt, over all three axes
    dy, dz = R[:, :, 1], R[:, :, 2]
    vy, vz = across[:, 0], across[:, 1]
    vx = np.cross(vy, dz) + np.cross(dy, vz)
    omega = (np.cross(R[:, :, 0], vx) + np.cross(dy, vy) + np.cross(dz, vz)) / 2
    motions = np.concatenate([centre, omega], axis=1)
    by_element = np.concatenate([motions[:-1], motions[1:]], axis=1)
    return (evaluation.response.rod.strain.gradient @ by_element[:, :, None])[:, :, 0]
