"""From a spec to solved rows: skeleton first, then the shards side by side, each finished one kept on disk.

A shard starts its rows from the skeleton and from its own rows only: which process solves it, after which other one,
and how often the work was interrupted, leaves no trace in the numbers."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from cfem.condensed.parameters import sampled
from cfem.condensed.pose import COORDINATES
from cfem.core.errors import CfemError, InputError, SpecError
from cfem.core.files import plain
from cfem.core.progress import progress
from cfem.core.provenance import versions
from cfem.core.spec import meaning
from cfem.dataset.reader import column_array, read_table
from cfem.dataset.schema import schema
from cfem.sample import shard, tour
from cfem.sample.contact import ContactPlan
from cfem.sample.plan import unit_rows
from cfem.sample.shard import Job
from cfem.sample.solver import Facts, SolverFactory
from cfem.sample.spec import SampleSpec

Advance = Callable[[int], None]


def _unseen(rows: int) -> None:
    """No progress to show."""


def sample(
    spec: SampleSpec, factory: SolverFactory, folder: Path, executor: Executor, made_from: str = "", quiet: bool = False
) -> dict[str, pa.Table]:
    """One table a split, rows in the order of their plan. `folder` keeps what is finished; a later call with the same
    arguments goes on from there. Raises NumericalError where no state of the skeleton converges."""
    job = make_job(spec, factory, folder, executor, made_from)
    first = tour.skeleton(job.u, spec.skeleton)
    rest = np.setdiff1d(np.arange(len(job.u)), first)
    with progress("simulate-sample", len(job.u), done=_finished(job, first, rest, spec.shard), quiet=quiet) as advance:
        files = [solve_skeleton(job, first, executor, advance)]
        files += solve_rows(job, rest, spec.shard, executor, advance)
    return merge(files, list(spec.splits))


def make_job(spec: SampleSpec, factory: SolverFactory, folder: Path, executor: Executor, made_from: str = "") -> Job:
    """The rows of all splits, to be solved into `folder`."""
    with _live_workers():
        facts: Facts = executor.submit(shard.facts, factory).result()
    if spec.space == "force" and facts.forces is None:
        what = f"space: force needs the smallest and largest multiplier of every actuator of scene '{facts.scene}'"
        raise SpecError(what, do="give each its `pressure`, or draw from another space")
    columns = facts.rows.n_a + facts.rows.n_c + len(sampled(facts.parameters))
    plans = {name: unit_rows(split, columns) for name, split in spec.splits.items()}
    meta = {
        "scene": facts.scene,
        "rest_e": facts.rest_e.tolist(),
        "reach": facts.reach.tolist(),
        "length": facts.length,
        "compliance": facts.compliance.tolist(),
        "plan": plain(meaning(spec, {"scene", "mesh", "out", "parameters"})),
        "made_from": made_from,
        "versions": versions(),
    }
    if facts.patch:
        meta["patch"] = {"points": facts.patch.points.tolist(), "origin": facts.patch.origin.tolist()}
    return Job(
        factory=factory,
        space=spec.space,
        u=np.concatenate(list(plans.values())),
        split=tuple(name for name, rows in plans.items() for _ in rows),
        id=tuple(index for rows in plans.values() for index in range(len(rows))),
        schema=schema(facts.rows, meta, facts.parameters, spec.third_order, facts.row_units),
        skeleton=folder,
        folder=folder,
        contact=contact_plan(spec, facts.rows.n_a),
    )


def contact_plan(spec: SampleSpec, n_a: int) -> ContactPlan | None:
    """What the spec's `contact` draws."""
    if spec.contact is None:
        return None
    turns = spec.contact.rotation is not None
    poses = [spec.contact.translation] + ([spec.contact.rotation] if turns else [])
    low, high = np.concatenate([np.tile([0.0, spec.contact.force], (n_a, 1)), *poses]).T.tolist()
    about_rest = tuple(sorted(COORDINATES.index(axis) for axis in set(spec.contact.about_rest)))
    return ContactPlan(tuple(low), tuple(high), turns, about_rest)


def solve_skeleton(job: Job, rows: np.ndarray, executor: Executor, advance: Advance = _unseen) -> Path:
    """The file with these rows (indices into job.u), made if it is not there, and beside it their states."""
    if not _has_skeleton(job):
        with _live_workers():
            executor.submit(shard.solve_skeleton, job, rows).result()
        advance(len(rows))
    return job.skeleton_rows


def solve_rows(
    job: Job,
    rows: np.ndarray,
    size: int,
    executor: Executor,
    advance: Advance = _unseen,
    share: slice = slice(None),
) -> list[Path]:
    """The files with these rows (indices into job.u), in shards of `size` at most; those that are there already, of the
    same rows, are kept. Each row depends on job.u, the indices, the size and the skeleton, on nothing else. share:
    which of the shards, all by default."""
    pieces = tour.shards(job.u, rows, size)
    mine = range(len(pieces))[share]
    waiting = [number for number in mine if not _holds(job, number, pieces[number])]
    with _live_workers():
        futures = [executor.submit(shard.solve_shard, job, number, pieces[number]) for number in waiting]
        for future in as_completed(futures):
            advance(future.result())
    return [job.shard_rows(number) for number in mine]


def _holds(job: Job, number: int, piece: np.ndarray) -> bool:
    """Whether the shard is solved. Rows that were chosen by a model may be others after it was trained anew."""
    try:
        table = read_table(job.shard_rows(number))
    except InputError:  # missing, or damaged since
        return False
    same = np.array_equal(column_array(table, "u"), job.u[piece])
    return same and table["id"].to_pylist() == [job.id[index] for index in piece]


def _has_skeleton(job: Job) -> bool:
    """Whether its rows and its states are there, and whole."""
    try:
        read_table(job.skeleton_rows)
        shard.read_knots(job.skeleton_states)
    except InputError:
        return False
    return True


def _finished(job: Job, first: np.ndarray, rest: np.ndarray, size: int) -> int:
    """Rows that an earlier run has solved."""
    pieces = tour.shards(job.u, rest, size)
    done = sum(len(piece) for number, piece in enumerate(pieces) if job.shard_rows(number).exists())
    return done + (len(first) if job.skeleton_rows.exists() else 0)


@contextmanager
def _live_workers() -> Iterator[None]:
    """Says what to do where a worker dies within."""
    try:
        yield
    except BrokenProcessPool:
        do = "run again to go on from what is finished, with fewer --workers if memory ran out"
        raise CfemError("a worker process died", where="simulate-sample", do=do) from None


def merge(files: Sequence[Path], splits: Sequence[str]) -> dict[str, pa.Table]:
    """Rows of all files by split, sorted by id."""
    table = pa.concat_tables([read_table(file).replace_schema_metadata() for file in files])
    table = table.replace_schema_metadata(read_table(files[0]).schema.metadata)
    return {split: table.filter(pc.equal(table["split"], split)).sort_by("id").combine_chunks() for split in splits}
