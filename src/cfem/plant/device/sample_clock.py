"""When a sample was taken and which command it followed: stamps of our clock or of another one, or the time of arrival.

Times of two clocks are compared only through their offset. It is estimated as the smallest difference between arrival
and stamp of the last samples, less the least time that a sample takes to arrive, which nobody but the user knows
(Cristian 1989 has the reason: no difference is smaller, and the smallest waited least)."""

from bisect import bisect_left
from collections import deque

from cfem.core.errors import InputError

HISTORY = 1000  # commands
WINDOW = 100  # samples of another clock that its offset is estimated from
TOLERANCE = 0.1  # s


class SampleClock:
    """Checks the time stamps of samples. tolerance: s by which stamps may lie in the future; latency: s that a sample
    takes to arrive at least; foreign: whether stamps are of another clock."""

    def __init__(self, tolerance: float = TOLERANCE, latency: float = 0.0, foreign: bool = False):
        self._tolerance, self._latency, self._foreign = tolerance, latency, foreign
        self._differences: deque[float] = deque(maxlen=WINDOW)

    def taken(self, stamp: float | None, arrival: float) -> float:
        """Our time (s) at which a sample was taken; stamp: s, None for none; arrival: our time, s. InputError where the
        stamp lies in the future; the offset of another clock is then estimated anew from the next sample on."""
        if stamp is None:
            return arrival - self._latency
        if not self._foreign:
            return min(stamp, self._judged(stamp, arrival))
        difference = arrival - stamp
        if self._differences and difference < min(self._differences) - self._tolerance:
            ahead = min(self._differences) - difference
            self._differences.clear()
            raise _future(ahead, "the other clock has jumped")
        self._differences.append(difference)
        return stamp + min(self._differences) - self._latency

    def _judged(self, stamp: float, arrival: float) -> float:
        if stamp - arrival > self._tolerance:
            raise _future(stamp - arrival, "is it of another clock?")
        return arrival


def _future(ahead: float, why: str) -> InputError:
    return InputError(f"the stamp lies {ahead:.2f} s in the future: {why}")


class CommandTimes:
    """The numbers of commands, from 1 on, by the times (s) at which they were given."""

    def __init__(self, history: int = HISTORY):
        self._times: deque[float] = deque(maxlen=history)
        self.count = 0

    def given(self, now: float) -> None:
        """The next command. Where the clock was put back the commands before are forgotten, their numbers are not."""
        if self._times and now < self._times[-1]:
            self._times.clear()
        self._times.append(now)
        self.count += 1

    def followed(self, time: float) -> int:
        """Number of the last command that was given before that time, 0 where none is known."""
        before = bisect_left(self._times, time)
        return self.count - len(self._times) + before if before else 0
