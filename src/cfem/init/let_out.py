"""How far each actuator is let out where others act: the lower end of its reach."""

import numpy as np
from scipy.optimize import linprog

from cfem.core.errors import NumericalError

_NOTHING = 0.01  # of an actuator's reach: less is not worth a bound


def let_out(compliance: np.ndarray, reach: np.ndarray, room: np.ndarray | float = np.inf) -> np.ndarray:
    """Least displacement (n_a,), at most 0, that each actuator takes where none pushes and none goes beyond its reach
    (n_a,), were the robot as compliant as at rest, compliance (n_a, n_a): a linear program for each.

    room: (n_a,) how far each can be let out at all: a chamber loses no more than it holds, and other chambers that
    press it flat meet more and more resistance, of which the compliance at rest knows nothing.

    An actuator that is held above it fights against those on the other side. Few commands do so, and few samples show
    it: a bound there would keep a robot among the states that its model knows least."""
    S = compliance / np.outer(reach, reach)
    programs = [linprog(row, A_ub=S, b_ub=np.ones(len(S)), bounds=(0.0, None)) for row in S]
    if not all(program.success for program in programs):
        raise NumericalError("how far actuators are let out: a linear program has no answer", where="init")
    low = np.array([program.fun for program in programs])
    return np.maximum(np.where(low < -_NOTHING, low, 0.0) * reach, -np.broadcast_to(room, reach.shape))
