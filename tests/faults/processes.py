"""Processes to be killed and interrupted: forks of one that has imported all, in their work after milliseconds."""

import multiprocessing
import os
import sys
from collections.abc import Sequence
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any
from unittest.mock import patch

from cfem.cli.run import run_command
from cfem.core.stage import Options


@cache
def processes() -> Any:
    """A context of multiprocessing."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["faults.warm"])
    # Before Python 3.13 it is not told sys.path, and would import another cfem that is installed; of threads a child of
    # a fork would start anew, one is enough.
    with patch.dict(os.environ, PYTHONPATH=os.pathsep.join(filter(None, sys.path)), OMP_NUM_THREADS="1"):
        first = context.Process(target=os.getpid)
        first.start()
        first.join()
    return context


def as_command(work: Any, arguments: tuple, said: Path) -> None:
    """Calls `work(*arguments)` with the signals and the exit codes of the command line. said: file for what it prints,
    there when signals are taken care of."""

    def run(_: Options) -> Any:
        os.dup2(os.open(said, os.O_WRONLY | os.O_CREAT), 1)
        os.dup2(1, 2)
        return work(*arguments)

    run_command(run)


def stage(package: str, spec: Path, overrides: Sequence[str], out: Path) -> dict[str, Any]:
    """The manifest that the stage of a package leaves. Training and control keep their state as often as they can."""
    from cfem.control.open_loop import resume
    from cfem.surrogate.networks import descent

    resume.EVERY = resume.DEARER = 0.0
    descent.CHECKPOINT_SECONDS = 0.0
    return import_module(f"cfem.{package}.stage").run(spec, overrides, out, Options(quiet=True))
