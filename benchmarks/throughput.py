"""Samples a second against workers, and what more samples and more workers would take; prints Markdown.

Usage: throughput.py [SAMPLE_YAML] [--rows 600], e.g. throughput.py pipelines/soft-finger/sample-large.yaml

Measured: one and two local workers, a task of a Dask cluster that does nothing, the writing of a shard, planning and
the end of a run. Estimated from these: start + skeleton + n planning + the largest of

    computing     n seconds a sample / workers, at least one shard
    parent        n / shard (seconds to hand a task to Dask and to take it back + to write a shard)
    transfer      (n bytes a row + workers bytes that every worker gets) / BANDWIDTH

and at last n seconds a row to merge, hash and write, in the memory of one process."""

import argparse
import os
import pickle
import resource
import tempfile
import time
from pathlib import Path

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"))

import numpy as np
import pyarrow as pa

from cfem.core.artefact.files import write_whole
from cfem.core.spec import load_spec
from cfem.dataset.reader import read_table
from cfem.dataset.writer import content_hash, write_table
from cfem.robot.load import load_scene_and_mesh
from cfem.sample.parameters import scene_parameters
from cfem.sample.plan import shards, skeleton, unit_rows
from cfem.sample.processes.pool import worker_pool
from cfem.sample.runner import make_job, merge, solve_rows, solve_skeleton
from cfem.sample.solver import FiniteElements
from cfem.sample.spec import SampleSpec, SplitSpec

BANDWIDTH = 125e6  # bytes/s: 1 Gbit/s
SAMPLES, WORKERS = (10**4, 10**6, 10**8), (2, 64, 1024)
MANY = 10**5  # rows by which planning and the end are timed
ROOT = Path(__file__).parents[1]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("spec", type=Path, nargs="?", default=ROOT / "pipelines/soft-finger/sample-large.yaml")
    parser.add_argument("--rows", type=int, default=600)
    chosen = parser.parse_args()
    spec = load_spec(chosen.spec, SampleSpec, [f"splits={{train: {{rows: {chosen.rows}, method: random}}}}"])
    scene = chosen.spec.parent / spec.scene
    factory = FiniteElements(
        *load_scene_and_mesh(scene, chosen.spec.parent / spec.mesh),
        spec.tolerance,
        scene_parameters(spec.parameters, scene),
        spec.third_order,
    )
    print(f"load {os.getloadavg()[0]:.1f} on {len(os.sched_getaffinity(0))} cores; {chosen.rows} samples\n")
    with tempfile.TemporaryDirectory() as folder:
        found = {workers: run(spec, factory, Path(folder) / str(workers), workers) for workers in (1, 2)}
        print("| workers | s to start | s for the skeleton | s for the shards | samples/s |\n|---|---|---|---|---|")
        for workers, (times, rows, _) in found.items():
            print(f"| {workers} | {' | '.join(f'{one:.2f}' for one in times)} | {rows / times[-1]:.1f} |")
        (start, skeleton, _), rows, (job, files) = found[1]
        costs = measured(spec, job, files) | {"start": start, "skeleton": skeleton}
    print(f"\nefficiency of two: {found[1][0][2] / found[2][0][2] / 2:.0%}\n")
    print("\n".join(f"{name}: {value:.3g}" for name, value in costs.items()))
    print("\n| samples | " + " | ".join(f"{count} workers" for count in WORKERS) + " | end | on disk |")
    print("|---" * (len(WORKERS) + 3) + "|")
    for n in SAMPLES:
        cells = [cell(*estimate(costs, spec.shard, n, count)) for count in WORKERS]
        end = f"{spoken(n * costs['s a row at the end'])}, {n * costs['bytes a row in memory'] / 1e9:.2g} GB"
        print(f"| {n:.0e} | {' | '.join(cells)} | {end} | {n * costs['bytes a row'] / 1e9:.2g} GB |")


def run(spec: SampleSpec, factory: FiniteElements, folder: Path, workers: int):
    """Seconds to start, for the skeleton and for the shards; rows of the shards; the job and its files."""
    with worker_pool(workers) as executor:
        begin = time.perf_counter()
        job = make_job(spec, factory, folder, executor)
        started = time.perf_counter()
        first = skeleton(job.u, spec.skeleton)
        files = [solve_skeleton(job, first)]
        spread = time.perf_counter()
        rest = np.setdiff1d(np.arange(len(job.u)), first)
        files += solve_rows(job, rest, spec.shard)
        end = time.perf_counter()
    return (started - begin, spread - started, end - spread), len(rest), (job, files)


def measured(spec: SampleSpec, job, files: list[Path]) -> dict[str, float]:
    """Costs by name, s and bytes."""
    table = merge(files, ["train"])["train"]
    piece = next(read_table(file) for file in files[1:])
    data = files[1].read_bytes()
    common = job.robot + job.skeleton_states.read_bytes()
    task = pickle.dumps(job.piece(np.arange(len(piece))))
    split = SplitSpec(rows=MANY, method="random")

    def plan():
        u = unit_rows(split, job.u.shape[1])
        return shards(u, np.setdiff1d(np.arange(MANY), skeleton(u, spec.skeleton)), spec.shard)

    many = pa.concat_tables([table] * (MANY // len(table)))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

    def end():
        tables = {"train": many.filter(pa.array(np.ones(len(many), bool))).sort_by("id").combine_chunks()}
        write_table(files[0].with_name("all.parquet"), tables["train"])
        return content_hash(tables)

    at_end = seconds(end) / len(many)
    memory = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024 / len(many)
    return {
        "s a sample": float(np.mean(table["seconds"].to_numpy())),
        "s a shard": float(np.sum(piece["seconds"].to_numpy())),
        "bytes a row": len(data) / len(piece),
        "bytes sent with a shard": len(task),
        "bytes sent to a worker once": len(common),
        "s to plan a row": seconds(plan) / MANY,
        "s to write a shard": seconds(lambda: write_whole(files[1].with_name("again"), data), 20),
        "s a task of Dask": dask_task(task, data),
        "s a row at the end": at_end,
        "bytes a row in memory": memory,
    }


def seconds(work, times: int = 1) -> float:
    begin = time.perf_counter()
    for _ in range(times):
        work()
    return (time.perf_counter() - begin) / times


def answer(task: bytes, size: int) -> bytes:
    return bytes(size)


def dask_task(task: bytes, data: bytes, count: int = 1000) -> float:
    """Seconds a task that does nothing, of the bytes that a shard's has, on two worker processes."""
    from distributed import Client, LocalCluster

    with LocalCluster(2, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster) as client:
        executor = client.get_executor(pure=False)
        executor.submit(answer, task, 1).result()
        begin = time.perf_counter()
        for future in [executor.submit(answer, task, len(data)) for _ in range(count)]:
            future.result()
        return (time.perf_counter() - begin) / count


def estimate(costs: dict[str, float], size: int, n: int, workers: int) -> tuple[float, str]:
    """Seconds until the last shard is written, and what takes them."""
    shards = -(-n // size)
    parts = {
        "computing": -(-shards // workers) * size * costs["s a sample"],
        "parent": shards * (costs["s a task of Dask"] + costs["s to write a shard"]),
        "transfer": (n * costs["bytes a row"] + workers * costs["bytes sent to a worker once"]) / BANDWIDTH,
    }
    name = max(parts, key=parts.get)
    return costs["start"] + costs["skeleton"] + n * costs["s to plan a row"] + parts[name], name


def cell(duration: float, limit: str) -> str:
    return f"{spoken(duration)} ({limit})"


def spoken(duration: float) -> str:
    for unit, size in (("d", 86400), ("h", 3600), ("min", 60)):
        if duration >= 2 * size:
            return f"{duration / size:.2g} {unit}"
    return f"{duration:.2g} s"


if __name__ == "__main__":
    main()
