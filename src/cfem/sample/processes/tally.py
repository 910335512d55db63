"""What the processes of a pool have solved, and what each is solving: numbers in shared memory, so that progress is one
of states and not of shards, says what a state costs, and says of a slow one which it is and why."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from cfem.core.console.shown import counted
from cfem.equilibrium.system.evaluation import SolveCost

SLOW = 12  # factorisations from which a solve that goes on is named
_SPLITS = ("train", "test")
_TOTALS = 4  # numbers before those of the processes: states, failed, factorisations, processes that joined
_EACH = 6  # of a process: when its solve began (ms; 0: none goes on), split, row, factorisations, steps, halvings


@dataclass(frozen=True)
class Ongoing:
    """A solve that goes on: of which row; factorizations, steps and halvings so far; seconds since it began."""

    split: str
    row: int
    factorizations: int
    steps: int
    halvings: int
    seconds: float

    def __str__(self) -> str:
        """'row 7 of train is slow: 9 load steps, 4 halved, 31 factorisations, 12 s'."""
        halved = f", {self.halvings} halved" if self.halvings else ""
        steps, spent = counted(self.steps, "load step"), counted(self.factorizations, "factorisation")
        return f"row {self.row} of {self.split} is slow: {steps}{halved}, {spent}, {self.seconds:.0f} s"


@dataclass(frozen=True)
class Tally:
    """Counts of solves."""

    states: int = 0  # solved or given up, those of the skeleton twice
    failed: int = 0  # given up
    factorizations: int = 0  # of all of them
    slowest: Ongoing | None = None  # of the solves that go on, by factorisations; None where none is slow

    def since(self, before: "Tally") -> "Tally":
        """Difference from the tally `before`."""
        return replace(
            self,
            states=self.states - before.states,
            failed=self.failed - before.failed,
            factorizations=self.factorizations - before.factorizations,
        )

    def __str__(self) -> str:
        """'12 factorisations a solve, 2 failed', while one is slow why that is instead of the mean; empty where nothing
        is known yet."""
        mean = f"{counted(round(self.factorizations / self.states), 'factorisation')} a solve" if self.states else ""
        parts = [str(self.slowest or mean), f"{self.failed} failed" if self.failed else ""]
        return ", ".join(part for part in parts if part)


def shared_counts(context: Any, processes: int) -> Any:
    """A multiprocessing.Array for so many processes."""
    return context.Array("q", _TOTALS + _EACH * processes)


def read(counts: Any) -> Tally:
    """Tally of all processes."""
    numbers = list(counts)
    return Tally(*numbers[:3], _slowest(numbers[_TOTALS:]))


def _slowest(numbers: Sequence[int]) -> Ongoing | None:
    """The solve that goes on with the most factorisations, None where none is slow."""
    solves = [numbers[start : start + _EACH] for start in range(0, len(numbers), _EACH)]
    begun, split, row, *cost = max(solves, key=lambda solve: solve[3] if solve[0] else -1)
    if not begun or cost[0] < SLOW:
        return None
    return Ongoing(_SPLITS[split], row, *cost, time.time() - begun / 1000)


_counts: Any = None  # of the pool that this process belongs to
_place = 0  # where its own numbers begin
_begun = False


class _WatchedCost(SolveCost):
    """Written to shared memory at each change."""

    def __setattr__(self, name: str, value: Any) -> None:
        super().__setattr__(name, value)
        if name in ("factorizations", "steps", "halvings"):
            _counts[_place + 3 + ("factorizations", "steps", "halvings").index(name)] = value


def join(counts: Any) -> None:
    """Makes this process count in `counts`, of `shared_counts`."""
    global _counts, _place
    with counts.get_lock():
        _counts, _place = counts, _TOTALS + _EACH * counts[3]
        counts[3] += 1


def begin(split: str, row: int) -> None:
    """A state's solve begins."""
    global _begun
    if _counts is not None:
        _begun = True
        _counts[_place : _place + _EACH] = [int(1000 * time.time()), _SPLITS.index(split), row, 0, 0, 0]


def cost() -> SolveCost:
    """Counts what a solve costs, in sight of progress where it is one that began here."""
    return _WatchedCost() if _begun else SolveCost()


def add(failed: bool, factorizations: int) -> None:
    """Counts one state more; its solve has ended."""
    global _begun
    _begun = False
    if _counts is not None:
        with _counts.get_lock():
            _counts[0] += 1
            _counts[1] += failed
            _counts[2] += factorizations
            _counts[_place] = 0
