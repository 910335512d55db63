"""`cfem run --quick`: a coarse answer first, from few of the states and goals that the specs ask for.

The mesh is that of the full run. Samples, and all that is made from them, go to folders of their own, whose names end
in `-quick`, so that nothing dear is replaced. The states of a sequence are the first ones of the full run, which takes
them from there (`cfem.sample.stage`)."""

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from math import ceil
from pathlib import Path
from typing import Any

from cfem.core.artefact.chain import describe
from cfem.core.artefact.stage_run import Stage
from cfem.core.errors import SpecError
from cfem.pipeline.plan import Step
from cfem.sample.spec import SEQUENCES
from cfem.sample.stage import quick_folder

SHARE = 5  # of so many states one is solved
FEWEST = 8  # states of a split, where the spec has as many
GOALS = 12  # of a trajectory


def quick_steps(steps: Sequence[Step]) -> list[Step]:
    """The steps with samples, and all that is made from them, coarse and in other folders. SpecError where no step
    takes samples."""
    if not any(step.kind == "sample" for step in steps):
        do = "run it without --quick, or name a folder with a sample.yaml"
        raise SpecError("--quick solves fewer states, and no stage here solves any", where="--quick", do=do)
    moved: set[str] = set()
    return [_quick(step, moved) for step in steps]


def _quick(step: Step, moved: set[str]) -> Step:
    """The step as it is where it reads nothing that has moved; else coarse, with its output in another folder. moved:
    real paths, to which that of the output is added."""
    stage = step.stage
    if step.kind != "sample" and not any(os.path.realpath(path) in moved for path in stage.inputs.values()):
        return step
    moved.add(os.path.realpath(stage.out))
    overrides = [*stage.overrides, *_coarser(step.kind, stage), *_redirected(stage, step.spec.parent, moved)]
    return replace(step, stage=describe(step.kind, step.spec, overrides), quick=True)


def _coarser(kind: str, stage: Stage) -> Iterator[str]:
    """Overrides with which the stage takes a fraction of the time."""
    spec = stage.spec
    if kind == "sample":
        for name, split in spec.splits.items():
            if split.method in SEQUENCES:
                yield f"splits.{name}.rows={max(min(FEWEST, split.rows), ceil(split.rows / SHARE))}"
        if spec.until is not None:
            yield "until=null"
    yield from (f"{key}=null" for key in ("mesh_error",) if getattr(spec, key, None) is not None)
    if kind == "control":
        yield from (f"{key}=false" for key in ("fe_based",) if getattr(spec, key, False))
        for name, trajectory in getattr(spec, "trajectories", {}).items():
            if isinstance(goals := getattr(trajectory, "goals", None), int) and goals > GOALS:
                yield f"trajectories.{name}.goals={GOALS}"


def _redirected(stage: Stage, base: Path, moved: set[str]) -> Iterator[str]:
    """Overrides of all paths in the spec that have moved."""
    for key, path in _paths(stage.spec.model_dump(), ""):
        if os.path.realpath(base / path) in moved:
            yield f"{key}={quick_folder(path)}"


def _paths(value: Any, key: str) -> Iterator[tuple[str, Path]]:
    """Paths at any depth of a spec, each with its key."""
    if isinstance(value, Path):
        yield key, value
    below = value.items() if isinstance(value, Mapping) else enumerate(value) if isinstance(value, list | tuple) else ()
    for name, inner in below:
        yield from _paths(inner, f"{key}.{name}" if key else str(name))
