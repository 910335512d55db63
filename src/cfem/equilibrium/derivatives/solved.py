"""Right-hand sides that are solved at a state, by the factor that its solve has left."""

import numpy as np

from cfem.core.errors import NumericalError
from cfem.equilibrium.condensation import EXACT, refined
from cfem.equilibrium.system.solution import Linearisation

SLOW = 0.7  # of the residual that a correction may leave where nothing but corrections can make it smaller
LEFT = 1e-5  # of the right-hand side: a larger residual is an error


def solved(
    linear: Linearisation, B: np.ndarray, start: np.ndarray | None = None, enough: float = EXACT
) -> tuple[np.ndarray, float]:
    """A^-1 B (n_dof, k) and the relative size of its residual, by a factor that may be of a state nearby, corrected as
    long as corrections help and more than `enough` is left. start: of A^-1 B, where one is known. NumericalError where
    more than 1e-5 is left."""
    Z, _, left = refined(linear.problem, linear.data, linear.factor, B, enough, start, SLOW)
    if not left <= LEFT:
        raise NumericalError(
            f"derivatives at this state are {left:.0e} off: its factorisation is of a state too far away, or its "
            "stiffness nearly singular; solve it again from a start that is nearer"
        )
    return Z, left
