"""A command in steps that are short enough for what depends on the way."""

from collections.abc import Callable

import numpy as np

SHORTEST = 1 / 64  # of a command: a way that is cut further than this ends
CONVERGED = "converged"


def carried_out(begin: np.ndarray, u: np.ndarray, longest: float | np.ndarray, go: Callable[[np.ndarray], str]) -> str:
    """How a command from `begin` to u (n_a,) ended. longest: that an actuator goes in one step, in its unit; go: one
    step to there, answers 'converged', or why not. A step that fails is halved."""
    way, share = u - begin, 0.0
    first = size = 1.0 / max(float((np.abs(way) / longest).max()), 1.0)
    while share < 1.0:
        there = min(1.0, share + size)
        status = go(begin + there * way)
        if status == CONVERGED:
            share, size = there, min(2 * size, max(first, size))
        elif size > SHORTEST and way.any():
            size /= 2
        else:
            return f"{status}, at {100 * share:.0f} % of the way"
    return CONVERGED
