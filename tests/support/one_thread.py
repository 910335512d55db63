"""One thread of this process in place of processes that solve, which take seconds to start."""

from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from unittest.mock import patch

from cfem.sample.processes import pool


@contextmanager
def one_thread(workers: int | None = None):
    """In place of `worker_pool`."""
    executor = ThreadPoolExecutor(1)
    try:
        yield executor
    finally:
        executor.shutdown(cancel_futures=True)


def solving_here():
    """A context in which all that samples does so in this process."""
    return patch.object(pool, "worker_pool", one_thread)


def solving_beside(processes=pool.worker_pool):
    """A context in which it does so in processes, as it does for a user."""
    return patch.object(pool, "worker_pool", processes)
