"""A Dask cluster as an executor.

Dask gives the tasks of a worker that it loses to another, and to those that join; a task that four workers died of is
given up (`distributed.scheduler.allowed-failures`)."""

import logging
import os
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Executor, Future
from contextlib import contextmanager
from functools import lru_cache
from typing import Any

from cfem.core.artefact.provenance import versions
from cfem.core.errors import InputError, SpecError
from cfem.core.optional import demand
from cfem.mechanics.factorization import solver_name
from cfem.sample.processes.workers import WorkersLost

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")  # numba and rslab are never asked for more
_CONNECT = "10s"
_SAME = "install the same versions on all machines"


@contextmanager
def cluster(address: str) -> Iterator[Executor]:
    """Executor of the workers of the scheduler at `address`. Left by an exception, what they have not begun is
    withdrawn. Raises SpecError where there is none, WorkersLost where Dask gives a task up or the scheduler ends,
    InputError where a worker is not like this process."""
    demand("distributed", where="--scheduler")
    from distributed import Client, KilledWorker

    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)  # what matters is raised below
    try:
        client = Client(address, timeout=_CONNECT, set_as_default=False)
    except (OSError, ValueError) as error:
        what = f"no Dask scheduler answers at {address}"
        raise SpecError(what, where="--scheduler", do="start one: dask scheduler") from error
    with client:
        try:
            for worker, error in client.run(_demand_alike, local_versions(), on_error="return").items():
                if isinstance(error, InputError):
                    raise error
                if isinstance(error, Exception) and not isinstance(error, OSError):  # who is gone is not asked
                    raise InputError(f"cannot run cfem: {error}", where=f"worker {worker}", do=_SAME)
            yield _DaskExecutor(client)
        except KilledWorker as killed:
            deaths, last = killed.allowed_failures + 1, killed.last_worker.address
            raise WorkersLost(f"{deaths} Dask workers died of one shard, the last at {last}") from None
        except CancelledError:
            raise WorkersLost(f"the Dask scheduler at {address} is gone") from None


class _DaskExecutor(Executor):
    """Sends arguments that are bytes to the cluster once, however many tasks have them."""

    def __init__(self, client: Any):
        self._client, self._tasks = client, client.get_executor(pure=False)
        self._sent: dict[bytes, Any] = {}

    def submit(self, function: Callable[..., Any], /, *arguments: Any) -> Future:
        sent = [self._once(argument) if isinstance(argument, bytes) else argument for argument in arguments]
        return self._tasks.submit(_alike, local_versions(), function, *sent)

    def _once(self, value: bytes) -> Any:
        import dask

        if value not in self._sent:
            with dask.config.set({"distributed.admin.large-graph-warning-threshold": "1TB"}):
                self._sent[value] = self._client.submit(bytes, value, pure=False)
        return self._sent[value]


@lru_cache(maxsize=1)
def local_versions() -> dict[str, str]:
    """Versions on which the digits of this process depend."""
    return versions() | {"solver": solver_name()}


def _alike(expected: dict[str, str], function: Callable[..., Any], *arguments: Any) -> Any:
    """Result of function(*arguments) in a worker, which may have joined just now."""
    from distributed import get_worker

    _demand_alike(expected, get_worker())
    return function(*arguments)


def _demand_alike(expected: dict[str, str], dask_worker: Any) -> None:
    """Raises InputError where a worker's digits may be others than those of a local run."""
    where, versions_here = f"worker {dask_worker.address}", local_versions()
    different = [name for name in sorted({*expected, *versions_here}) if expected.get(name) != versions_here.get(name)]
    if different:
        listed = ", ".join(f"{name} {versions_here.get(name)} in place of {expected.get(name)}" for name in different)
        do = f"start it with CFEM_SOLVER={expected['solver']}" if different == ["solver"] else _SAME
        raise InputError(f"has other versions: {listed}", where=where, do=do)
    if dask_worker.state.nthreads != 1 or any(os.environ.get(name) != "1" for name in THREADS):
        do = f"start it with --nthreads 1, {'=1, '.join(THREADS)}=1"
        raise InputError("computes on several threads", where=where, do=do)
