"""Processes of this machine that solve, on one thread each, and never outlive the process that started them."""

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from types import ModuleType
from typing import Any, TypeVar

from cfem.core.console.progress import say
from cfem.core.system import cores
from cfem.mechanics.factorization import solver_name
from cfem.sample.processes import tally
from cfem.sample.processes.tally import Tally
from cfem.sample.processes.workers import Workers, WorkersLost

# Sums in another order, by another number of threads, would end in other digits.
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS", "RAYON_NUM_THREADS")
FRESH = 3  # times that lost workers are replaced

T = TypeVar("T")


def with_workers(workers: Workers, work: Callable[[Executor], T]) -> T:
    """Result of work(executor). Local processes of which one is lost are replaced, and `work` called again, which goes
    on from what is finished; Dask does so by itself. Raises WorkersLost where they are lost time and again."""
    if workers.scheduler:
        from cfem.sample.processes.cluster import cluster

        with cluster(workers.scheduler) as executor:
            return work(executor)
    for fresh in reversed(range(FRESH + 1)):
        try:
            with worker_pool(workers.count) as executor:
                return work(executor)
        except WorkersLost as lost:
            if not fresh:
                raise
            say(f"sample: {lost.what}; going on with fresh workers")
    raise AssertionError("unreachable")


@contextmanager
def worker_pool(workers: int | None = None) -> Iterator[Executor]:
    """Executor of `workers` processes (default: one a core), a single one included: the numbers then come from the same
    environment however many there are. Left by an exception (Ctrl-C too), the workers are killed in the middle of what
    they do."""
    others_children = set(multiprocessing.active_children())
    context = _WithoutMain()
    # Safe path: no process takes modules from the working folder.
    with _environment({**dict.fromkeys((*ONE_THREAD, "PYTHONSAFEPATH"), "1"), "CFEM_SOLVER": solver_name()}):
        executor = Pool(workers or cores(), context)
        try:
            yield executor
        except BaseException:
            for process in set(multiprocessing.active_children()) - others_children:
                process.kill()
            raise
        finally:
            executor.shutdown(cancel_futures=True)


class _Process(multiprocessing.context.SpawnProcess):
    """Does not run the program's own file once more, as spawned processes do: it may be a script that samples at once,
    without `if __name__ == "__main__"`, and all that a worker is given is of cfem."""

    @staticmethod
    def _Popen(process: Any) -> Any:
        program = sys.modules["__main__"]
        sys.modules["__main__"] = ModuleType("__main__")
        try:
            return multiprocessing.context.SpawnProcess._Popen(process)
        finally:
            sys.modules["__main__"] = program


class _WithoutMain(multiprocessing.context.SpawnContext):
    Process = _Process


class Pool(ProcessPoolExecutor):
    """Processes that count the states that they solve."""

    def __init__(self, workers: int, context: Any):
        self._counts = tally.shared_counts(context, workers)
        super().__init__(workers, context, initializer=_become_worker, initargs=(self._counts,))

    def tally(self) -> Tally:
        """Tally of all of them so far."""
        return tally.read(self._counts)


def _become_worker(counts: Any) -> None:
    """Ctrl-C goes to the whole process group: the parent answers for all. A parent that is killed answers no more."""
    tally.join(counts)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


@contextmanager
def _environment(values: dict[str, str]) -> Iterator[None]:
    """Sets environment variables for processes started meanwhile."""
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
