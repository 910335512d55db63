"""Worker processes which compute on one thread each, and which never outlive the one that started them."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager

# Sums in another order, by another number of threads, would end in other digits.
_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS", "RAYON_NUM_THREADS")


@contextmanager
def worker_pool(workers: int | None = None) -> Iterator[Executor]:
    """`workers` processes (default: one a core), a single one included: the numbers then come from the same environment
    however many there are. Left by an exception (Ctrl-C too), the workers are killed in the middle of what they do."""
    others = set(multiprocessing.active_children())
    executor = ProcessPoolExecutor(
        workers or len(os.sched_getaffinity(0)), multiprocessing.get_context("spawn"), initializer=_become_worker
    )
    with _environment(dict.fromkeys(_ONE_THREAD, "1")):
        try:
            yield executor
        except BaseException:
            for process in set(multiprocessing.active_children()) - others:
                process.kill()
            raise
        finally:
            executor.shutdown(cancel_futures=True)


def _become_worker() -> None:
    """Ctrl-C goes to the whole process group: the parent answers for all. A parent that is killed answers no more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


@contextmanager
def _environment(values: dict[str, str]) -> Iterator[None]:
    """For processes started meanwhile."""
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
