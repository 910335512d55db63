"""Waiting for other processes, which start slowly on a busy machine."""

import time
from collections.abc import Callable

PATIENCE = 90.0  # s, a bound for what has failed; nothing waits so long otherwise


def wait_for(condition: Callable[[], bool], seconds: float = PATIENCE) -> None:
    """Returns once the condition holds. AssertionError after `seconds`."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.02)
