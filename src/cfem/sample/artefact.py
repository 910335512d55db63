"""The files of a dataset folder and what its manifest says of them."""

import shutil
import time
from collections import Counter
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

from cfem.core.errors import InputError, NumericalError
from cfem.core.judgement import FAILED_SHARE, poor
from cfem.core.shown import duration
from cfem.dataset.inspect import cost
from cfem.dataset.reader import CONVERGED, read_table
from cfem.dataset.writer import content_hash, write_table
from cfem.sample.pool import with_workers
from cfem.sample.runner import sample
from cfem.sample.solver import SolverFactory
from cfem.sample.spec import SampleSpec
from cfem.sample.workers import Workers


def fill(folder: Path, spec: SampleSpec, factory: SolverFactory, made_from: str, workers: Workers) -> dict[str, Any]:
    """Writes one Parquet file a split into `folder`; results for the manifest."""
    begin = time.perf_counter()
    files = {split: folder / f"{split}.parquet" for split in spec.splits}
    shards = folder / "shards"
    try:
        tables = {split: read_table(file) for split, file in files.items()}
    except InputError:  # not there yet
        tables = with_workers(
            workers, lambda executor: sample(spec, factory, shards, executor, made_from, workers.timeout)
        )
        for split, table in tables.items():
            write_table(files[split], table)
    shutil.rmtree(shards, ignore_errors=True)
    return {**results(tables), "wall_seconds": time.perf_counter() - begin, "content": content_hash(tables)}


def results(tables: dict[str, pa.Table]) -> dict[str, Any]:
    """What the sampling gave and cost. Raises NumericalError where no row of a split converged."""
    for split, table in tables.items():
        if not pc.any(pc.equal(table["status"], CONVERGED)).as_py():
            raise NumericalError(f"no row of '{split}' converged: {table['reason'][0]}", where="simulate-sample")
    table = pa.concat_tables(tables.values())
    solved = table.filter(pc.equal(table["status"], CONVERGED))
    failed = len(table) - len(solved)
    costs = cost(table)
    worst = pc.max(solved["residual"]).as_py()
    return {
        "headline": [
            f"{len(solved)} of {len(table)} states converged, largest residual {worst:.1e}; "
            f"per state {costs['factorizations_per_sample']:.2f} factorisations and "
            f"{duration(pc.mean(table['seconds']).as_py())} on one core"
        ],
        "judgement": failures(table.filter(pc.not_equal(table["status"], CONVERGED)), len(table)),
        "rows": {split: len(table) for split, table in tables.items()},
        "failed": failed,
        **costs,
        "residual_max": worst,
    }


def failures(failed: pa.Table, rows: int) -> list[dict[str, Any]]:
    """What is wrong with so many failed rows."""
    if len(failed) <= FAILED_SHARE * rows:
        return []
    why, _ = Counter(failed["reason"].to_pylist()).most_common(1)[0]
    share = f"{len(failed)} of {rows} states failed, {100 * len(failed) / rows:.0f} %"
    return [poor(f"{share}. The most frequent cause is: {why}. The reach may be more than the robot can do")]
