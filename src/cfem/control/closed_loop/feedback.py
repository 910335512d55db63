"""The correction of goals by samples that may be late and rare: the one rule of all static controllers. C has the same
in `cfem_feedback.c`.

A sample has the number of the command that it followed. It corrects once, against the reference of that command: what
the model expected of the command, less the correction that the command contained. Anti-windup is by back-calculation
(Astrom and Hagglund 1995, section 3.5): with the effectors x' that the model expected and the correction c of that
tick,

    e = x' - c - sample

which is goal - sample where the model got to the corrected goal, and grows no further where bounds, rates, a robot that
cannot get there, or a search of one step a tick have kept it away.

A sample that misses the model by much more, or much less, than the last one did is rejected until the next confirms it
(`cfem.predict.estimation.gate`): what the model misses, x' - sample, does not depend on the correction, and changes
slowly with the goal, so that a jump is either the sensor's or a new load.

The age of a sample is 1 where it followed the last command. The largest age and the smallest interval of the last
samples say how many samples come late, and that says K_I (`cfem.plant.gains`)."""

from collections import deque

import numpy as np

from cfem.condensed.far import FAR, in_metres
from cfem.core.errors import InputError
from cfem.plant.gains import Gains, late_samples
from cfem.predict.estimation.gate import Gate, SampleVerdict

HISTORY = 1000  # ticks; a sample that followed an older command corrects nothing
WINDOW = 8  # samples whose ages and intervals count
SPREAD = 0.005  # lengths of the robot: standard deviation of what the model misses from one sample to the next
CONFIRMED = 2  # samples in a row that agree on a jump, from which on it counts


class Feedback:
    """Correction of goals by the samples of the effectors (PI).

    total: (n_e,) mm, K_I sum(e)
    moved: (n_e,) mm by which the goal is moved, K_P e + K_I sum(e)
    integral: K_I of the last sample
    late: samples taken before the one that first shows a correction
    missed: (n_e,) mm, what the model missed by at the last sample that corrected: x' - sample
    rejected: whether the last sample was new and corrected nothing
    given: number of commands so far
    sampled: number of the command that the last sample followed, 0 before the first"""

    def __init__(
        self,
        gains: Gains,
        measured: np.ndarray,
        history: int = HISTORY,
        rest_e: np.ndarray | float = 0.0,
        far: np.ndarray | float = np.inf,
    ):
        """measured: (n_e,) bool, rows that correct; history: ticks; far: (n_e,) mm from rest_e (n_e,) mm, beyond which
        no sample can be."""
        self._gains, self._measured = gains, measured
        self._rest_e, self._far = rest_e, far
        self.total, self.moved, self.missed = (np.zeros(len(measured)) for _ in range(3))
        self._gate, self.rejected = Gate(samples=CONFIRMED), False
        self._expected: deque[tuple[np.ndarray, np.ndarray]] = deque(maxlen=history)  # effectors and correction
        self._ages: deque[int] = deque(maxlen=WINDOW)
        self._intervals: deque[int] = deque(maxlen=WINDOW)
        self.given = self.sampled = self.late = 0
        self.integral = gains.integral_at(0)

    def commanded(self, expected: np.ndarray) -> None:
        """Notes what a command is expected to lead to, after each command; expected: (n_e,) mm, where the model has the
        effectors under it."""
        self.given += 1
        self._expected.append((expected, self.moved))

    def sample(self, tick: int, x_e: np.ndarray) -> bool:
        """Takes a sample and returns True if it corrects. One that was taken before, that is older than the history,
        not finite, too far from rest, in metres or rejected changes nothing. InputError for a command that was not
        given yet.

        tick: number of the command that the sample followed, from 1 on
        x_e: (n_e,) mm"""
        if tick > self.given:
            what = f"the sample is of tick {tick}, and {self.given} commands were given"
            raise InputError(what, do="number the samples by the command that they follow, from 1 on")
        self.rejected = tick > self.sampled
        if not self.rejected:
            return False
        age, interval = self.given - tick + 1, tick - self.sampled
        first, self.sampled = not self.sampled, tick
        if age > len(self._expected):
            return False
        expected, moved = self._expected[-age]
        missed = np.where(self._measured, expected - x_e, 0.0)
        if not np.isfinite(missed).all() or (np.abs(x_e - self._rest_e) > self._far)[self._measured].any():
            return False
        if in_metres(x_e, self._rest_e, self._far):
            return False
        self._ages.append(age)
        if not first:
            self._intervals.append(interval)
        self.late = late_samples(max(self._ages) - 1, min(self._intervals, default=1))
        self.integral = self._gains.integral_at(self.late)
        if self._gate.judge(self._innovation_square(missed), int(self._measured.sum())) is SampleVerdict.REJECTED:
            return False
        self.missed, self.rejected = missed, False
        self._correct(missed - np.where(self._measured, moved, 0.0))
        return True

    def _innovation_square(self, missed: np.ndarray) -> float:
        """Square of the normalised innovation: of what the model misses by (n_e,) mm against the last time; rotations
        do not count."""
        share = (missed - self.missed) / (SPREAD * np.broadcast_to(self._far, missed.shape) / FAR)
        return float(share @ share)

    def take_back(self, correction: np.ndarray) -> None:
        """Adds to the integral what no sample said: (n_e,) mm."""
        self.total, self.moved = self.total + correction, self.moved + correction

    def _correct(self, error: np.ndarray) -> None:
        total = self.total + self.integral * error
        length = float(np.linalg.norm(total))
        self.total = total * min(1.0, self._gains.bound / length) if length > 0 else total
        self.moved = self._gains.proportional * error + self.total
