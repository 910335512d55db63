"""A Dask scheduler and workers on loopback, each a process group of its own, to be killed one by one."""

import json
import os
import signal
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

from support.waiting import wait_for

TESTS = Path(__file__).parents[1]


class DaskProcesses:
    def __init__(self, folder: Path, **config: str):
        """config: of the scheduler, as Dask's environment variables have it."""
        self._folder, self._all = folder, []
        file = folder / "scheduler.json"
        options = ("--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(file))
        self.scheduler = self._start("scheduler", *options, **config)
        wait_for(file.exists)
        wait_for(lambda: file.read_text().endswith("}"))
        self.address = json.loads(file.read_text())["address"]

    def worker(self, *options: str) -> subprocess.Popen:
        return self._start("worker", self.address, "--nthreads", "1", "--no-dashboard", *options)

    def wait_for_workers(self, count: int) -> None:
        from distributed import Client

        with Client(self.address, set_as_default=False) as client:
            client.wait_for_workers(count, timeout=30)

    def _start(self, *words: str, **config: str) -> subprocess.Popen:
        environment = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
        here = os.pathsep.join([str(TESTS), *filter(None, [environment.get("PYTHONPATH")])])
        environment |= {"PYTHONPATH": here, "DASK_TEMPORARY_DIRECTORY": str(self._folder), **config}
        with open(self._folder / f"{len(self._all)}.log", "wb") as log:
            process = subprocess.Popen(
                [sys.executable, "-m", "dask", *words], stdout=log, stderr=log, env=environment, start_new_session=True
            )
        self._all.append(process)
        return process

    def kill(self, process: subprocess.Popen) -> None:
        """With its nanny, or with its worker."""
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()

    def end(self) -> None:
        for process in self._all:
            if process.poll() is None:
                self.kill(process)


@contextmanager
def dask_processes(folder: Path, **config: str):
    processes = DaskProcesses(folder, **config)
    try:
        yield processes
    finally:
        processes.end()
