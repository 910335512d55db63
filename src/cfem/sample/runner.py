"""Solved rows of a spec: skeleton first, then the shards side by side, each finished one kept on disk.

A shard starts its rows from the skeleton and from its own rows only: which process solves it, after which other one,
and how often the work was interrupted, leaves no trace in the numbers. Workers are sent all they need and send back
files, which are written here: they need to see no disk of this machine."""

import hashlib
import json
import pickle  # nosec B403
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future
from dataclasses import dataclass, replace
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from cfem.condensed.parameters import sampled
from cfem.condensed.skin import read_skin, skin_from
from cfem.core.artefact.files import plain, write_whole
from cfem.core.artefact.provenance import versions
from cfem.core.console.progress import doing, progress
from cfem.core.errors import InputError, SpecError
from cfem.core.spec import meaning
from cfem.dataset.reader import column_array, read_table
from cfem.dataset.schema import SKIN, schema, with_skin_rows
from cfem.mechanics.factorization import solver_name
from cfem.sample import shard
from cfem.sample.contact import contact_plan
from cfem.sample.knots_file import read_knots
from cfem.sample.overlap import FILE
from cfem.sample.plan import shards, skeleton, unit_rows, with_idle
from cfem.sample.processes.tally import Tally
from cfem.sample.processes.workers import WorkersLost
from cfem.sample.shard import Piece
from cfem.sample.solver import Facts, SolverFactory
from cfem.sample.spec import SampleSpec, SkinSpec


@dataclass(frozen=True, kw_only=True)
class Job(Piece):
    """All rows to be solved, who solves them, and where they are kept.

    robot: a pickled SolverFactory
    folder: of the shards
    skeleton: folder of the states that all rows start from
    asked: how the skin is to be found, None where there is none
    skin: its file, empty where it is not known yet
    timeout: s without a finished shard after which the workers are given up, None to wait for ever"""

    robot: bytes
    executor: Executor
    skeleton: Path
    folder: Path
    asked: SkinSpec | None = None
    skin: bytes = b""
    timeout: float | None = None

    @property
    def skin_file(self) -> Path:
        return self.skeleton / SKIN

    @property
    def skeleton_states(self) -> Path:
        return self.skeleton / "skeleton.npz"

    @property
    def skeleton_rows(self) -> Path:
        return self.skeleton / "skeleton.parquet"

    def shard_rows(self, number: int) -> Path:
        return self.folder / f"shard-{number:05d}.parquet"

    def piece(self, indices: np.ndarray) -> Piece:
        """Piece of the rows of u with these indices."""
        return Piece(
            space=self.space,
            u=self.u[indices],
            split=tuple(self.split[index] for index in indices),
            id=tuple(self.id[index] for index in indices),
            schema=self.schema,
            contact=self.contact,
            together=self.together,
        )


def sample(
    spec: SampleSpec,
    factory: SolverFactory,
    folder: Path,
    executor: Executor,
    made_from: str = "",
    timeout: float | None = None,
    known: Path | None = None,
) -> dict[str, pa.Table]:
    """Tables of all splits, rows in the order of their plan. `folder` keeps what is finished; a later call with the
    same arguments goes on from there. known: folder of a dataset of the first rows of this plan, which are kept as they
    are, and with the modes of its skin. Raises NumericalError where no state of the skeleton converges, WorkersLost."""
    job = make_job(spec, factory, folder, executor, made_from, timeout)
    kept = {} if known is None else {split: read_table(known / f"{split}.parquet") for split in spec.splits}
    has = [number < len(kept.get(split, ())) for split, number in zip(job.split, job.id, strict=True)]
    new, skin = np.flatnonzero(~np.array(has)), None if known is None else skin_of(known)
    if not len(new):
        if skin:
            write_whole(job.skin_file, skin)
        return merge([known / f"{split}.parquet" for split in kept], list(spec.splits))
    first = new[skeleton(job.u[new], spec.skeleton)]
    job = solve_skeleton(job, first, skin)
    solved = solve_rows(job, np.setdiff1d(new, first), spec.shard)
    return merge([job.skeleton_rows, *solved, *(known / f"{split}.parquet" for split in kept)], list(spec.splits))


def make_job(
    spec: SampleSpec,
    factory: SolverFactory,
    folder: Path,
    executor: Executor,
    made_from: str = "",
    timeout: float | None = None,
) -> Job:
    """Job of the rows of all splits, to be solved into `folder`."""
    robot = pickle.dumps(factory)
    doing("starting the workers and solving the robot at rest")
    facts: Facts
    _, facts = next(_results(executor, timeout, {"facts of the robot": (shard.facts, robot)}))
    _demand_space(spec, facts)
    together = 1.0
    if spec.space == "pulling" and spec.contact is None:
        doing("finding how far all actuators can be pulled at once")
        _, together = next(_results(executor, timeout, {"pull of all actuators": (shard.pull_together, robot)}))
    columns = facts.rows.n_a + facts.rows.n_c + len(sampled(facts.parameters))
    plans = {
        name: with_idle(unit_rows(split, columns), facts.rows.n_a, spec.idle) for name, split in spec.splits.items()
    }
    meta = _meta(spec, facts, made_from, together)
    return Job(
        robot=robot,
        executor=executor,
        timeout=timeout,
        space=spec.space,
        u=np.concatenate(list(plans.values())),
        split=tuple(name for name, rows in plans.items() for _ in rows),
        id=tuple(index for rows in plans.values() for index in range(len(rows))),
        schema=schema(facts.rows, meta, facts.parameters, spec.third_order, facts.row_units, spec.loads),
        skeleton=folder,
        folder=folder,
        contact=contact_plan(spec, facts),
        together=together,
        asked=None if facts.surface is None or spec.space == "rest" else spec.skin,
    )


def _meta(spec: SampleSpec, facts: Facts, made_from: str, together: float) -> dict[str, Any]:
    """Metadata of the dataset, as plain data."""
    meta = {
        "scene": facts.scene,
        "robot": facts.robot,
        "rest_e": facts.rest_e.tolist(),
        "reach": facts.reach.tolist(),
        "length": facts.length,
        "compliance": facts.compliance.tolist(),
        "together": together,
        "plan": plain(meaning(spec, {"scene", "mesh", "out", "parameters"})),
        "made_from": made_from,
        "versions": versions() | {"solver": solver_name()},
    }
    if facts.viscosity is not None:
        meta["viscosity"] = [plain(vars(material)) for material in facts.viscosity]
        meta["inner"] = facts.inner
    if facts.masses:
        meta["masses"] = dict(facts.masses)
    if facts.patch:
        meta["patch"] = {"points": facts.patch.points.tolist(), "origin": facts.patch.origin.tolist()}
    return meta


def _demand_space(spec: SampleSpec, facts: Facts) -> None:
    """Raises SpecError where the scene lacks what the space to draw from needs."""
    if spec.space == "force" and facts.forces is None:
        what = f"space: force needs the smallest and largest multiplier of every actuator of scene '{facts.scene}'"
        raise SpecError(what, do="give each its `pressure`, or draw from another space")
    if spec.space == "rest" and not sampled(facts.parameters):
        what = f"space: rest without sampled parameters is one state of scene '{facts.scene}', over and over"
        raise SpecError(what, do="name `parameters` that the scene's response depends on, or draw from another space")


def skin_of(dataset: Path) -> bytes:
    """The file of the skin of a dataset, empty where it has none."""
    return (dataset / SKIN).read_bytes() if (dataset / SKIN).exists() else b""


def solve_skeleton(job: Job, rows: np.ndarray, known: bytes | None = None) -> Job:
    """Job with the skin that these rows (indices into job.u) show, if one is asked for, or with that which is known
    (empty: none). Makes the file of the rows, and beside it those of their states and of the skin, where they are not
    there."""
    if not _has_skeleton(job):
        call = (shard.solve_skeleton, job.robot, job.piece(rows), job.asked, known)
        finds = job.asked is not None and known is None
        solves = len(rows) * (2 if finds else 1)  # once to find the rows of the skin, once more with them
        with progress("skeleton, from which all other states start", solves, estimate=False, **_shown(_counter(job))):
            _, (records, states, skin) = next(_results(job.executor, job.timeout, {"skeleton": call}))
        calls = {"overlaps of the skeleton": (shard.overlaps, job.robot, states)}
        _, overlap = next(_results(job.executor, job.timeout, calls))
        with_skin = skinned(job, skin)
        if skin:
            write_whole(job.skin_file, skin)
        if overlap:
            write_whole(job.skeleton / FILE, json.dumps(overlap).encode())
        write_whole(job.skeleton_states, states)
        write_whole(job.skeleton_rows, shard.rows_bytes(records, with_skin.schema))
    return skinned(job, job.skin_file.read_bytes()) if job.asked else job


def skinned(job: Job, skin: bytes) -> Job:
    """Job with the rows of the skin in this file; as it is where that is empty."""
    if not skin:
        return job
    names = skin_from(skin).names
    return replace(job, skin=skin, schema=with_skin_rows(job.schema, names, hashlib.sha256(skin).hexdigest()))


def solve_rows(job: Job, rows: np.ndarray, size: int, share: slice = slice(None)) -> list[Path]:
    """Files with these rows (indices into job.u), in shards of `size` at most; those that are there already, of the
    same rows, are kept. Each row depends on job.u, the indices, the size and the skeleton, on nothing else. share:
    which of the shards, all by default."""
    pieces = shards(job.u, rows, size)
    numbers_of_share = range(len(pieces))[share]
    waiting = [number for number in numbers_of_share if not _holds(job, number, pieces[number])]
    if waiting:
        states = job.skeleton_states.read_bytes()
        calls = {
            job.shard_rows(number).name: (shard.solve_shard, job.robot, job.skin, states, job.piece(pieces[number]))
            for number in waiting
        }
        counter = _counter(job)
        total, unsolved = (sum(len(pieces[number]) for number in numbers) for numbers in (numbers_of_share, waiting))
        with progress("solving states", total, done=total - unsolved, **_shown(counter)) as advance:
            for name, table in _results(job.executor, job.timeout, calls):
                write_whole(job.folder / name, table)
                if counter is None:
                    advance(len(calls[name][-1].u))
    return [job.shard_rows(number) for number in numbers_of_share]


def _results(
    executor: Executor, timeout: float | None, calls: Mapping[str, tuple[Any, ...]]
) -> Iterator[tuple[str, Any]]:
    """The name of each call (a function and its arguments) and what it gives, in the order in which they end. Raises
    WorkersLost where a process dies, or `timeout` s pass without a call that ends."""
    done: SimpleQueue[Future] = SimpleQueue()
    futures: dict[Future, str] = {}
    try:
        for name, call in calls.items():
            futures[executor.submit(*call)] = name
        for future in list(futures):
            future.add_done_callback(done.put)
        while futures:
            future = done.get(timeout=timeout)
            result = future.result()
            yield futures.pop(future), result
    except (Empty, BrokenExecutor) as lost:
        how = f"no worker has finished anything for {timeout:g} s" if isinstance(lost, Empty) else "a worker died"
        named, more = list(futures.values())[:3], len(futures) - 3
        raise WorkersLost(f"{how}; unfinished: {', '.join(named)}{f' and {more} more' * (more > 0)}") from None
    finally:
        for future in futures:
            future.cancel()


def _holds(job: Job, number: int, piece: np.ndarray) -> bool:
    """True if the shard is solved. Rows that were chosen by a model may be others after it was trained again."""
    try:
        table = read_table(job.shard_rows(number))
    except InputError:  # missing, or damaged since
        return False
    same = np.array_equal(column_array(table, "u"), job.u[piece])
    return same and table["id"].to_pylist() == [job.id[index] for index in piece]


def _has_skeleton(job: Job) -> bool:
    """True if the skeleton's rows and its states are there, and whole."""
    try:
        read_table(job.skeleton_rows)
        read_knots(job.skeleton_states)
        if job.asked:
            read_skin(job.skin_file)
    except InputError:
        return False
    return True


def _counter(job: Job) -> Callable[[], Tally] | None:
    """Counts the states that are solved from now on; None where the executor does not tell."""
    count = getattr(job.executor, "tally", None)
    if count is None:
        return None
    before = count()
    return lambda: count().since(before)


def _shown(counter: Callable[[], Tally] | None) -> dict[str, Any]:
    """Arguments of the progress: how many states are solved, and what they cost."""
    if counter is None:
        return {}
    return {"poll": lambda: counter().states, "note": lambda: str(counter())}


def merge(files: Sequence[Path], splits: Sequence[str]) -> dict[str, pa.Table]:
    """Rows of all files by split, sorted by id."""
    table = pa.concat_tables([read_table(file).replace_schema_metadata() for file in files])
    table = table.replace_schema_metadata(read_table(files[0]).schema.metadata)
    return {split: table.filter(pc.equal(table["split"], split)).sort_by("id").combine_chunks() for split in splits}
