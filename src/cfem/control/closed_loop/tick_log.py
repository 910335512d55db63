"""Ticks of a device on disk as soon as they are known: what it did is not lost with it."""

import json
import math
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from cfem.core.artefact.files import disk_errors, plain
from cfem.core.console.progress import say
from cfem.core.errors import CfemError

SYNC = 1.0  # s: what a loss of power takes at most; every tick would wear the disk and hold up the device


@contextmanager
def tick_log(folder: Path) -> Iterator[Callable[[dict[str, Any]], None]]:
    """Yields `append(row)`, which adds a JSON line to the first free `interrupted-<n>.jsonl` of the folder: it outlives
    the process at once, and the machine after SYNC. The file goes when the work within ends well; else it stays, and
    the error says how much it holds."""
    number, synced = 1, -math.inf
    while (path := folder / f"interrupted-{number}.jsonl").exists():
        number += 1
    count = 0
    with disk_errors(path):
        file = open(path, "w", encoding="utf-8")  # noqa: SIM115 - errors of the work within are not the disk's
    with file:

        def append(row: dict[str, Any]) -> None:
            """Adds a row to the file, at once."""
            nonlocal count, synced
            with disk_errors(path):
                file.write(json.dumps(_known(plain(row))) + "\n")
                file.flush()
                if time.monotonic() - synced >= SYNC:
                    os.fsync(file.fileno())
                    synced = time.monotonic()
            count += 1

        try:
            yield append
        except BaseException as error:
            if not count:
                path.unlink()
                raise
            before = "the tick before is" if count == 1 else f"the {count} ticks before are"
            kept = f"{before} kept in {os.path.normpath(path)}"
            if isinstance(error, CfemError):
                raise type(error)(f"{error.what}; {kept}", where=error.where, do=error.do) from error
            say(f"control: {kept}")
            raise
    path.unlink()


def _known(value: Any) -> Any:
    """null for what was not measured."""
    if isinstance(value, dict):
        return {key: _known(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_known(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
