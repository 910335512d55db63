"""`cfem sample --around TASK`: states where a task goes and a model of the samples so far is unsure, added to them.

The task is a run of `cfem control`, whose tables say where the actuators stood. Of these states, those are solved on
which models of parts of the samples differ most, spread out (`cfem.active_learning.choose`). A few more states of the
task go to the test split, where they judge: the error of the model on the task, before and after."""

import pickle  # nosec B403
import time
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from cfem.active_learning.choose import choose, disagreement
from cfem.active_learning.until_error import committee, largest_error, model
from cfem.condensed.parameters import references, sampled, shares
from cfem.condensed.spread import spread
from cfem.core.artefact.files import write_whole
from cfem.core.console.progress import doing
from cfem.core.console.shown import duration, length
from cfem.core.errors import InputError
from cfem.dataset.parquet import read_parquet
from cfem.dataset.reader import Dataset, as_dataset, column_array, read_table
from cfem.dataset.schema import SKIN
from cfem.dataset.writer import content_hash, write_table
from cfem.sample import artefact, shard
from cfem.sample.processes.pool import with_workers
from cfem.sample.processes.workers import Workers
from cfem.sample.shard import Piece
from cfem.sample.solver import SolverFactory
from cfem.sample.spec import SampleSpec, Until

TABLES = ("loop.parquet", "trajectories.parquet")
MOST = 2000  # states of a task that are looked at
TERMS = Until(error="1 mm")  # as sampling until an error fits its models


def fill(folder: Path, spec: SampleSpec, factory: SolverFactory, workers: Workers) -> dict[str, Any]:
    """Writes the dataset of spec.around.base and the states that are added; returns results for the manifest."""
    begin, around = time.perf_counter(), spec.around
    tables = {split: read_table(around.base / f"{split}.parquet") for split in ("train", "test")}
    known = as_dataset(tables["train"])
    visited = task_states(around.task, known)
    doing("fitting models of parts of the samples")
    full_model, parts = committee(known, TERMS)
    s, p, u = places(known, visited, full_model.form)
    score, judges = disagreement(full_model, parts, s, p), spread(u, min(around.judges, len(u) // 2), 0)
    candidates = np.setdiff1d(np.arange(len(u)), judges)
    chosen = candidates[choose(u[candidates], score[candidates], around.add)]
    skin = (around.base / SKIN).read_bytes() if (around.base / SKIN).exists() else b""
    doing(f"solving {len(chosen)} states where the task goes, and {len(judges)} that judge")
    pieces = [
        Piece(
            space="displacement",
            u=u[rows],
            split=(split,) * len(rows),
            id=tuple(_free(tables[split], len(rows))),
            schema=tables[split].schema,
        )
        for split, rows in (("train", chosen), ("test", judges))
    ]
    robot = pickle.dumps(factory)
    solved = with_workers(
        workers, lambda executor: [executor.submit(shard.solve_alone, robot, skin, piece).result() for piece in pieces]
    )
    new = {piece.split[0]: _table(data) for piece, data in zip(pieces, solved, strict=True)}
    joined = {split: pa.concat_tables([tables[split], new[split]]).combine_chunks() for split in tables}
    if skin:
        write_whole(folder / SKIN, skin)
    for split, table in joined.items():
        write_table(folder / f"{split}.parquet", table)
    plain = artefact.results(joined, artefact.kept_skin(folder))
    outcome = verdict(known, joined, new, score, time.perf_counter() - begin)
    return {
        **plain,
        "around": outcome,
        "headline": [sentence(outcome), *plain["headline"]],
        "wall_seconds": outcome["seconds"],
        "content": content_hash(joined),
    }


def task_states(task: Path, known: Dataset) -> np.ndarray:
    """Displacements (m, n_a) mm at which the actuators stood. InputError where the task's folder has none."""
    tables = [read_parquet(task / name, ["delta_a"]) for name in TABLES if (task / name).exists()]
    if not tables:
        what = f"holds neither {' nor '.join(TABLES)}"
        raise InputError(what, where=str(task), do="name the result folder of cfem control")
    states = np.array([row for table in tables for row in table["delta_a"].to_pylist()], dtype=float)
    if states.ndim != 2 or states.shape[1] != known.delta_a.shape[1]:
        raise InputError("is of a robot with another number of actuators", where=str(task), do="name a run of this one")
    states = np.unique(states[np.isfinite(states).all(axis=1)].round(9), axis=0)
    if not len(states):
        raise InputError(
            "has no tick at which the actuators' displacements are known",
            where=str(task),
            do="name a run with an observer, or with a sensor of the displacements",
        )
    return states[np.linspace(0, len(states) - 1, min(MOST, len(states))).astype(int)]


def places(known: Dataset, delta_a: np.ndarray, form: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Inputs s (m, n_a) of the model's form and p (m, n_p) of the reference, and rows u (m, n) of the unit cube."""
    reach, n = np.array(known.meta["reach"]), len(delta_a)
    u = (delta_a - reach[:, 0]) / (reach[:, 1] - reach[:, 0])
    learned = sampled(known.parameters)
    p_reference = np.array([parameter["reference"] for parameter in known.meta.get("parameters", [])])
    reference_shares = shares(learned, references(learned))
    u = np.hstack([u, np.tile(reference_shares, (n, 1))])
    if form != "displacement":
        raise InputError(
            "sampling around a task needs a model of form displacement", do="train with form: displacement"
        )
    return delta_a, np.tile(p_reference, (n, 1)), u


def verdict(
    known: Dataset, joined: dict[str, pa.Table], new: dict[str, pa.Table], score: np.ndarray, seconds: float
) -> dict[str, Any]:
    """Errors (mm) of the effectors at the judges, which no model has learned from, before and after."""
    judges, added = as_dataset(new["test"]), as_dataset(new["train"])
    before, after = model(known, TERMS), model(as_dataset(joined["train"]), TERMS)
    return {
        "added": len(added),
        "judges": len(judges),
        "samples": len(known) + len(added),
        "expected": float(np.nanmax(score)),
        "before": largest_error(before, judges) if len(judges) else None,
        "after": largest_error(after, judges) if len(judges) else None,
        "seconds": seconds,
    }


def sentence(outcome: dict[str, Any]) -> str:
    if outcome["before"] is None:
        return f"{outcome['added']} states added where the task goes, in {duration(outcome['seconds'])}; none judges"
    return (
        f"{outcome['added']} states added where the task goes, in {duration(outcome['seconds'])}; largest error at "
        f"{outcome['judges']} other states of the task {length(outcome['before'])} before, "
        f"{length(outcome['after'])} after"
    )


def _free(table: pa.Table, count: int) -> range:
    """Numbers that no row has."""
    first = int(column_array(table, "id").max()) + 1
    return range(first, first + count)


def _table(data: bytes) -> pa.Table:
    import io

    import pyarrow.parquet as pq

    return pq.read_table(io.BytesIO(data))
