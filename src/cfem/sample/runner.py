"""From a spec to solved rows: skeleton first, then the shards side by side, each finished one kept on disk.

A shard starts its rows from the skeleton and from its own rows only: which process solves it, after which other one,
and how often the work was interrupted, leaves no trace in the numbers."""

from collections.abc import Sequence
from concurrent.futures import Executor, as_completed
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from cfem.core.errors import CfemError
from cfem.core.progress import progress
from cfem.core.provenance import versions
from cfem.core.spec import meaning
from cfem.dataset.reader import read_table
from cfem.dataset.schema import schema
from cfem.sample import shard, tour
from cfem.sample.plan import unit_rows
from cfem.sample.shard import Job
from cfem.sample.solver import Facts, SolverFactory
from cfem.sample.spec import SampleSpec


def sample(
    spec: SampleSpec, factory: SolverFactory, folder: Path, executor: Executor, made_from: str = "", quiet: bool = False
) -> dict[str, pa.Table]:
    """One table a split, rows in the order of their plan. `folder` keeps what is finished; a later call with the same
    arguments goes on from there. Raises NumericalError where no state of the skeleton converges."""
    try:
        facts = executor.submit(shard.facts, factory).result()
        job = _job(spec, factory, facts, folder, made_from)
        first = tour.skeleton(job.u, spec.skeleton)
        rest = np.setdiff1d(np.arange(len(job.u)), first)
        files = _solve(job, first, tour.shards(job.u, rest, spec.shard), executor, quiet)
    except BrokenProcessPool:
        do = "run again to go on from what is finished, with fewer --workers if memory ran out"
        raise CfemError("a worker process died", where="simulate-sample", do=do) from None
    return merge(files, list(spec.splits))


def _job(spec: SampleSpec, factory: SolverFactory, facts: Facts, folder: Path, made_from: str) -> Job:
    plans = {name: unit_rows(split, facts.rows.n_a) for name, split in spec.splits.items()}
    meta = {
        "scene": facts.scene,
        "rest_e": facts.rest_e.tolist(),
        "reach": facts.reach.tolist(),
        "length": facts.length,
        "plan": meaning(spec, {"scene", "mesh", "out"}),
        "made_from": made_from,
        "versions": versions(),
    }
    return Job(
        factory=factory,
        space=spec.space,
        u=np.concatenate(list(plans.values())),
        split=tuple(name for name, rows in plans.items() for _ in rows),
        id=tuple(index for rows in plans.values() for index in range(len(rows))),
        schema=schema(facts.rows, meta),
        folder=folder,
    )


def _solve(job: Job, first: np.ndarray, shards: Sequence[np.ndarray], executor: Executor, quiet: bool) -> list[Path]:
    """The files that hold all rows, those made that are not there yet."""
    files = [job.shard_rows(number) for number in range(len(shards))]
    waiting = [number for number, file in enumerate(files) if not file.exists()]
    begun = job.skeleton_rows.exists()
    done = len(first) * begun + sum(len(rows) for number, rows in enumerate(shards) if number not in waiting)
    with progress("simulate-sample", len(job.u), done=done, quiet=quiet) as advance:
        if not begun:
            executor.submit(shard.solve_skeleton, job, first).result()
            advance(len(first))
        futures = [executor.submit(shard.solve_shard, job, number, shards[number]) for number in waiting]
        for future in as_completed(futures):
            advance(future.result())
    return [job.skeleton_rows, *files]


def merge(files: Sequence[Path], splits: Sequence[str]) -> dict[str, pa.Table]:
    """Rows of all files by split, sorted by id."""
    table = pa.concat_tables([read_table(file).replace_schema_metadata() for file in files])
    table = table.replace_schema_metadata(read_table(files[0]).schema.metadata)
    return {split: table.filter(pc.equal(table["split"], split)).sort_by("id").combine_chunks() for split in splits}
