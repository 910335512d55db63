"""Start of a motion."""

import numpy as np

from cfem.equilibrium.system.solution import State
from cfem.fe_motion.problem import MovingProblem
from cfem.fe_motion.scheme import Motion
from cfem.mechanics import viscosity as viscous


def at_rest(problem: MovingProblem, state: State, t: float = 0.0) -> Motion:
    """Standing still in an equilibrium."""
    none = np.zeros_like(state.x)
    return Motion(t, state.x, none, none, none, state.pressure, state.lam, settled_memory(problem, state.x))


def settled_memory(problem: MovingProblem, x: np.ndarray) -> viscous.ViscousMemory | None:
    """Memory of a robot that has stood at positions x (n, 3) mm for long; None without viscosity."""
    if not problem.viscosity:
        return None
    return viscous.settled(problem.body, problem.viscosity, problem.evaluate(x, np.empty(0)).response)
