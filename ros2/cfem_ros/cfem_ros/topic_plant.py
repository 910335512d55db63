"""A robot that is on topics: what it was told is published by the node, what was measured last is its answer."""

import math

import numpy as np

from cfem.plant.device.sample_clock import CommandTimes
from cfem.plant.protocol import Measurement

UNSEEN = Measurement(np.full(3, np.nan), None, None, 0, "the effector is not measured")


class TopicPlant:
    """A measurement has the number of the command that was the last before its time."""

    def __init__(self):
        self._commands = CommandTimes()
        self.now, self._last, self._taken = 0.0, UNSEEN, -math.inf

    def take(self, x_e: np.ndarray, taken: float) -> None:
        """A sample (3,) mm and its time, s of our clock; one that is not newer than the last is left out."""
        if taken > self._taken:
            self._taken = taken
            self._last = Measurement(x_e, None, None, self._commands.followed(taken), "converged")

    def step(self, u: np.ndarray, kind: str) -> Measurement:
        """The last sample; the command u (n_a,) is given at `now` (s)."""
        self._commands.given(self.now)
        return self._last

    def age(self) -> float:
        """s since the last sample was taken, inf before the first."""
        return self.now - self._taken

    def forget(self) -> None:
        """The samples, after the clock was put back: times before tell nothing."""
        self._last, self._taken = UNSEEN, -math.inf
