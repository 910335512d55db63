"""A dataset of the synthetic robot as an artefact, made by one thread, and what may befall its making."""

import os
from pathlib import Path
from typing import Any

from sample.synthetic import Factory
from support.one_thread import solving_here

from cfem.cli.run import run_command
from cfem.core.artefact.stage_run import Stage
from cfem.core.stage import Options, run_stage
from cfem.sample import artefact
from cfem.sample.processes.workers import Workers
from cfem.sample.spec import SampleSpec

SPEC = SampleSpec(
    scene="scene.yaml",
    mesh="mesh",
    out="out",
    splits={
        "train": {"rows": 40, "method": "scrambled-halton", "seed": 1},
        "test": {"rows": 20, "method": "random", "seed": 2},
    },
    skeleton=6,
    shard=4,
)
PLAN = {"train": list(range(40)), "test": list(range(20))}


def make(out: Path, delay: float = 0.0, force: bool = False) -> dict[str, Any]:
    """The dataset's manifest. delay: seconds a solve takes at least."""
    stage = Stage("sample", 1, SPEC, {}, out, ("scene", "mesh", "out"), precious=True)

    def work(folder: Path) -> dict[str, Any]:
        return artefact.fill(folder, SPEC, Factory(delay), stage.made_from(), Workers())

    with solving_here():
        return run_stage(stage, work, Options(force=force, quiet=True))


def make_quietly(out: Path, delay: float) -> None:
    """As a process of its own: for being killed."""
    make(out, delay)


def make_as_command(out: Path, delay: float) -> None:
    """With the signals and exit codes of the command line."""
    os.close(1)
    os.close(2)
    os.open(os.devnull, os.O_RDWR)
    os.open(os.devnull, os.O_RDWR)
    run_command(lambda _: make(out, delay))
