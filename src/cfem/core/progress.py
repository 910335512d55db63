"""Progress on stderr: a bar with the time left on a terminal, a plain line now and then elsewhere."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def progress(label: str, total: int, *, done: int = 0, quiet: bool = False) -> Iterator[Callable[[int], None]]:
    """Yields `advance(n)`. `done` counts what an earlier run finished and does not enter the estimate of time left."""
    if quiet or total <= done:
        yield lambda n: None
    elif sys.stderr.isatty():
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

        columns = (TextColumn(label), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
        with Progress(*columns, console=Console(stderr=True)) as bar:
            task = bar.add_task(label, total=total, completed=done)
            yield lambda n: bar.advance(task, n)
    else:
        yield _lines(label, total, done)


def _lines(label: str, total: int, done: int) -> Callable[[int], None]:
    start = shown = time.monotonic()
    count = done

    def advance(n: int) -> None:
        nonlocal count, shown
        count += n
        now = time.monotonic()
        if now - shown > 10 or count >= total:
            shown = now
            left = (now - start) / max(count - done, 1) * (total - count)
            print(f"{label}: {count}/{total}, {left:.0f} s left", file=sys.stderr, flush=True)

    return advance
