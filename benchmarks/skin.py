"""What the whole shape costs and how good it is, beside its targets; Markdown.

Usage: skin.py [ROBOT ...] [--sampling ROBOT ...] [--repeats 3], all robots below unless given; after

    cfem sample pipelines/ROBOT/sample.yaml --set splits.test.rows=50 && cfem train pipelines/ROBOT/train.yaml

The error is that of `cfem train` at the test states. Sampling with a skin over without is that of CPU seconds in one
process, from the start to the written file, each the least of the repeats, which take turns; for soft-finger and
stiff-flop unless given. Times of a shape are CPU times, medians of many calls, and ratios: `model.shape` over one
`model.at_displacement`, C over `model.shape`. C is gcc -O2 in double precision, called from Python."""

import argparse
import os
import tempfile
import time
from concurrent.futures import Executor, Future
from pathlib import Path

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"))

import numpy as np

import cfem
from cfem.core.artefact.manifest import read_manifest
from cfem.core.spec import load_spec
from cfem.dataset.writer import content_hash, write_table
from cfem.export.compiled.shape import CompiledShape
from cfem.robot.load import load_scene_and_mesh
from cfem.sample import shard
from cfem.sample.parameters import scene_parameters
from cfem.sample.runner import sample
from cfem.sample.solver import FiniteElements
from cfem.sample.spec import SampleSpec

ROOT = Path(__file__).parents[1]
CALLS = 300


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("robots", nargs="*", default=["soft-finger", "stiff-flop", "trunk"])
    parser.add_argument("--sampling", nargs="*", default=["soft-finger", "stiff-flop"])
    parser.add_argument("--repeats", type=int, default=3)
    given = parser.parse_args()
    print(f"load {os.getloadavg()[0]:.1f} on {len(os.sched_getaffinity(0))} cores\n")
    columns = "robot | modes | nodes | largest error (mm) | % of length | target | folder / its skin (MB)"
    times = "model.shape (ms) | over a query | C (ms) | over model.shape"
    print(f"| {columns} | {times} |\n{'|---' * 11}|")
    for name in given.robots:
        print(shape_row(name), flush=True)
    columns = "robot | states | sampling with skin over without | target | CPU (s) | factorisations"
    print(f"\n| {columns} |\n{'|---' * 6}|")
    for name in given.sampling:
        print(sampling_row(name, given.repeats), flush=True)


def shape_row(name: str) -> str:
    folder = ROOT / "models" / name / "spectral"
    model, found = cfem.load_model(folder), read_manifest(folder)["results"]["skin"]
    target = "0.05 mm" if name == "soft-finger" else "0.1 %"
    size, skin = (sum(one.stat().st_size for one in folder.glob(what)) / 1e6 for what in ("*", "skin.npz"))
    states = model.domain.states[:, : model.rows.n_a]
    with tempfile.TemporaryDirectory() as place:
        spec = Path(place) / "export.yaml"
        spec.write_text(f"model: {folder}\nout: {place}/out\nformats: [c]\nshape: true\n")
        cfem.run_stage("export", spec)
        compiled = CompiledShape(Path(place) / "out" / "c")
        own, query, c = (median(call, states) for call in (model.shape, model.at_displacement, compiled))
    return (
        f"| {name} | {found['modes']} | {found['nodes']} | {found['largest_mm']:.2g} | "
        f"{found['largest_percent_of_length']:.2g} | {target} | {size:.2f} / {skin:.2f} | {1e3 * own:.2g} | "
        f"{own / query:.2g} | {1e3 * c:.2g} | {c / own:.2g} |"
    )


def median(call, states: np.ndarray) -> float:
    """CPU seconds."""
    spent = []
    for number in range(CALLS):
        begin = time.process_time()
        call(states[number % len(states)])
        spent.append(time.process_time() - begin)
    return float(np.median(spent))


def sampling_row(name: str, repeats: int) -> str:
    once(name, ["splits={train: {rows: 3, method: scrambled-halton}}", "skeleton=2"])  # compiles kernels, loads modules
    spent: dict[str, list[float]] = {"skin={}": [], "skin=null": []}
    counts = {}
    for _ in range(repeats):
        for skin, seconds in spent.items():
            begin = time.process_time()
            counts[skin] = once(name, [skin])
            seconds.append(time.process_time() - begin)
    with_skin, without = (min(seconds) for seconds in spent.values())
    (rows, more), (_, fewer) = counts.values()
    return f"| {name} | {rows} | {with_skin / without:.2f} | 1.5 | {with_skin:.1f} / {without:.1f} | {more} / {fewer} |"


class Here(Executor):
    """Runs what it is given at once, in this process."""

    def submit(self, fn, /, *args, **options):
        future: Future = Future()
        future.set_result(fn(*args, **options))
        return future


def once(name: str, more: list[str]) -> tuple[int, int]:
    """Rows and factorisations of one sampling by a robot's spec."""
    path = ROOT / "pipelines" / name / "sample.yaml"
    spec = load_spec(path, SampleSpec, more)
    scene, mesh = path.parent / spec.scene, path.parent / spec.mesh
    parameters = scene_parameters(spec.parameters, scene)
    factory = FiniteElements(*load_scene_and_mesh(scene, mesh), spec.tolerance, parameters, spec.third_order)
    shard._solver.cache_clear()
    shard._watching.cache_clear()
    with tempfile.TemporaryDirectory() as folder:
        tables = sample(spec, factory, Path(folder), Here())
        content_hash(tables)
        for split, table in tables.items():
            write_table(Path(folder) / f"{split}.parquet", table)
    return sum(map(len, tables.values())), sum(sum(one["factorizations"].to_pylist()) for one in tables.values())


if __name__ == "__main__":
    main()
