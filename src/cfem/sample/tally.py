"""What the processes of a pool have solved: numbers in shared memory, so that progress is one of states and not of
shards, and says what a state costs."""

from dataclasses import dataclass
from typing import Any

_counts: Any = None  # of the pool that this process belongs to


@dataclass(frozen=True)
class Tally:
    """states: solved or given up, those of the skeleton twice; failed: given up; factorizations: of all of them."""

    states: int = 0
    failed: int = 0
    factorizations: int = 0

    def since(self, before: "Tally") -> "Tally":
        """Difference from the tally `before`."""
        return Tally(
            self.states - before.states,
            self.failed - before.failed,
            self.factorizations - before.factorizations,
        )

    def __str__(self) -> str:
        """'12 factorisations a solve, 2 failed'."""
        cost = f"{self.factorizations / max(self.states, 1):.0f} factorisations a solve"
        return f"{cost}, {self.failed} failed" if self.failed else cost


def join(counts: Any) -> None:
    """Makes this process count in `counts`, a multiprocessing.Array of three numbers."""
    global _counts
    _counts = counts


def add(failed: bool, factorizations: int) -> None:
    """One state more."""
    if _counts is not None:
        with _counts.get_lock():
            _counts[0] += 1
            _counts[1] += failed
            _counts[2] += factorizations
