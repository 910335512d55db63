"""A command in steps that are short enough for what depends on the way."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

SHORTEST = 1 / 64  # of a command, or an eighth of its first step: a way that is cut further than this ends
ROUNDING = 1e-9  # of a command
CONVERGED = "converged"


def carried_out(begin: np.ndarray, u: np.ndarray, longest: float | np.ndarray, go: Callable[[np.ndarray], str]) -> str:
    """Carries out a command from `begin` to u (n_a,) in steps; says how it ended. longest: that an actuator goes in one
    step, in its unit; go: one step to there, answers 'converged', or why not. A step that fails is halved."""
    path, share = u - begin, 0.0
    first = size = 1.0 / max(np.ceil(float((np.abs(path) / longest).max()) - ROUNDING), 1.0)
    while share < 1.0:
        reached = 1.0 if share + size > 1.0 - ROUNDING else share + size
        status = go(begin + reached * path)
        if status == CONVERGED:
            share, size = reached, min(2 * size, max(first, size))
        elif size > min(SHORTEST, first / 8) * (1 + ROUNDING) and path.any():
            size = (reached - share) / 2
        else:
            return f"{status}, at {100 * share:.0f} % of the way"
    return CONVERGED


def all_carried_out(
    begins: Sequence[np.ndarray],
    ends: Sequence[np.ndarray],
    longest: Sequence[np.ndarray],
    state: Any,
    step: Callable[[Sequence[np.ndarray], Any], Any],
) -> Any:
    """The state in which several robots end that go together (`carried_out`), from `state`; step: from deltas, one of
    each robot, and the state before to the state there. The state that failed where the way ends before."""
    cuts, last = np.cumsum([len(begin) for begin in begins])[:-1], state

    def go(target: np.ndarray) -> str:
        nonlocal state, last
        last = step(np.split(target, cuts), state)
        if last.converged:
            state = last
        return CONVERGED if last.converged else last.status.value

    if state.converged:
        carried_out(*(np.concatenate(arrays) for arrays in (begins, ends, longest)), go)
    return last
