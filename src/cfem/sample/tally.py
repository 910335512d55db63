"""How many states the processes of a pool have solved: a number in shared memory, so that progress is one of states and
not of shards."""

from typing import Any

_count: Any = None  # of the pool that this process belongs to


def join(count: Any) -> None:
    """Makes this process count in `count`, a multiprocessing.Value."""
    global _count
    _count = count


def add_one() -> None:
    """One more state is solved."""
    if _count is not None:
        with _count.get_lock():
            _count.value += 1
