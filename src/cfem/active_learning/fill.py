"""The states of a dataset: by plan, by rounds until an error is reached, or where a task goes."""

from pathlib import Path
from typing import Any

from cfem.active_learning import around, until_error
from cfem.sample import artefact
from cfem.sample.processes.workers import Workers
from cfem.sample.solver import SolverFactory
from cfem.sample.spec import SampleSpec


def fill(
    folder: Path, spec: SampleSpec, factory: SolverFactory, made_from: str, workers: Workers, known: Path | None = None
) -> dict[str, Any]:
    """Writes one Parquet file a split into `folder`, as spec.around or spec.until ask; results for the manifest. known:
    folder of a dataset of the plan's first rows, where there is one."""
    if spec.around is not None:
        return around.fill(folder, spec, factory, workers)
    if spec.until is not None:
        return until_error.fill(folder, spec, factory, made_from, workers)
    return artefact.fill(folder, spec, factory, made_from, workers, known)
