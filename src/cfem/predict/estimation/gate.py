"""Gate of samples that may correct a filter: the normalised innovation of a Kalman filter against its chi-squared
distribution (Bar-Shalom, Li and Kirubarajan, *Estimation with Applications to Tracking and Navigation*, 2001, section
5.4).

Of an innovation nu with the covariance S that the filter states, the square d = nu^T S^-1 nu is chi-squared of as many
numbers n as nu has, and

    sqrt(2 d / spread) - sqrt(2 n - 1)

is nearly a standard normal deviate (Fisher, *Statistical Methods for Research Workers*, 1925). A sample is rejected
where that exceeds `sigmas`. The spread is 1 for a filter whose model is right; else it is the mean of d / n of late, so
that a robot which is not the model's is not rejected for ever. A sample raises it by a bounded share.

Rejected samples that miss by about as much, one after the other, are no accident: after `samples` of these the filter
is wrong, and has to begin again. Samples that contradict each other are a sensor that fails, of which a filter learns
nothing."""

from dataclasses import dataclass, field
from enum import Enum
from math import inf, isfinite, sqrt
from typing import Annotated

from pydantic import Field

from cfem.core.spec import Spec

FIRST = 10.0  # spread before the first sample: of a filter that has not settled
MEMORY = 10.0  # samples after which one counts for 1/e in the spread
LARGEST = 2.0  # of the spread: what a sample adds to its mean
ALIKE = 4.0  # ratio of squares of innovations below which two rejected samples agree


class GateSpec(Spec):
    """Samples that a filter rejects."""

    sigmas: Annotated[float, Field(gt=0)] = 5.0
    """Standard deviations by which a sample may miss what the filter expects. One that misses by more is rejected."""
    samples: Annotated[int, Field(ge=1)] = 8
    """Rejected samples in a row that agree with each other, after which the filter begins again."""


class SampleVerdict(Enum):
    """Decision on a sample. RESTART: the filter begins again, with this sample."""

    ACCEPTED = "accepted"
    REJECTED = "rejected"
    RESTART = "restart"


@dataclass
class Gate:
    """Judge of samples, one after the other.

    sigmas, samples: as in `GateSpec`
    memory: samples after which one counts for 1/e in the spread
    first: spread before the first sample
    alike: ratio of the squares of two rejected innovations below which they agree
    spread: mean of d / n of late, at least 1
    agreeing: rejected samples in a row that agree
    last: square of the last rejected innovation, 0 where the last sample was accepted
    """

    sigmas: float = 5.0
    samples: int = 8
    memory: float = MEMORY
    first: float = FIRST
    alike: float = ALIKE
    spread: float = field(init=False)
    agreeing: int = field(default=0, init=False)
    last: float = field(default=0.0, init=False)

    def __post_init__(self) -> None:
        self.spread = self.first

    @classmethod
    def of(cls, spec: GateSpec) -> "Gate":
        return cls(spec.sigmas, spec.samples)

    @property
    def spec(self) -> GateSpec:
        return GateSpec(sigmas=self.sigmas, samples=self.samples)

    def deviate(self, square: float, numbers: int) -> float:
        """Standard deviations by which a sample misses more than expected; square, numbers: d and n."""
        return sqrt(2.0 * square / self.spread) - sqrt(2.0 * numbers - 1.0)

    def accepts(self, square: float, numbers: int) -> bool:
        """True where a sample with this innovation would be accepted; changes nothing."""
        return numbers < 1 or self.deviate(square, numbers) <= self.sigmas

    def judge(self, square: float, numbers: int) -> SampleVerdict:
        """The verdict on a sample; square, numbers: d and n.

        d is infinite where the filter found no answer to the sample, and negative where its covariance is not positive:
        then it is lost, and begins again."""
        if numbers < 1:
            return SampleVerdict.ACCEPTED
        if square < 0:
            self.restart()
            return SampleVerdict.RESTART
        if not square < inf:  # nan too
            square = inf
        accepted = self.accepts(square, numbers)
        agrees = self.last > 0 and self._agrees(square)
        if accepted or agrees:
            counted = min(square / numbers, LARGEST * self.spread)
            self.spread = max(1.0, self.spread + (counted - self.spread) / self.memory)
        if accepted:
            self.agreeing, self.last = 0, 0.0
            return SampleVerdict.ACCEPTED
        self.agreeing, self.last = self.agreeing + 1 if agrees else 1, square
        if self.agreeing < self.samples:
            return SampleVerdict.REJECTED
        self.restart()
        return SampleVerdict.RESTART

    def restart(self) -> None:
        """Returns to the state before the first sample."""
        self.spread, self.agreeing, self.last = self.first, 0, 0.0

    def _agrees(self, square: float) -> bool:
        """True where a rejected square is about as large as the last one, or neither is finite."""
        if not (isfinite(square) and isfinite(self.last)):
            return True
        return max(square, self.last) <= self.alike * min(square, self.last)
