"""The dataset is the same whatever the number of workers, their order, and the interruptions."""

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import numpy as np
import pytest
from sample.synthetic import Factory

from cfem.core.errors import CfemError
from cfem.dataset.writer import content_hash
from cfem.sample.pool import worker_pool
from cfem.sample.runner import sample
from cfem.sample.spec import SampleSpec

SPEC = SampleSpec(
    scene="scene.yaml",
    mesh="mesh",
    out="out",
    splits={
        "train": {"rows": 40, "method": "scrambled-halton", "seed": 1},
        "test": {"rows": 20, "method": "random", "seed": 2},
    },
    skeleton=8,
    shard=7,
)
CHILD = """
import sys
sys.path.insert(0, {tests!r})
from pathlib import Path
from sample.synthetic import Factory
from sample.test_runner import SPEC
from cfem.sample.pool import worker_pool
from cfem.sample.runner import sample
if __name__ == "__main__":
    with worker_pool(2) as executor:
        sample(SPEC, Factory(delay=0.02), Path(sys.argv[1]), executor)
"""


def in_process(folder, spec=SPEC, factory=None):
    with ThreadPoolExecutor(1) as executor:
        return sample(spec, factory or Factory(), folder, executor, quiet=True)


@pytest.fixture(scope="module")
def tables(tmp_path_factory):
    return in_process(tmp_path_factory.mktemp("whole"))


def test_rows_come_in_the_order_of_their_plan_whatever_the_order_of_work(tables):
    assert {split: table["id"].to_pylist() for split, table in tables.items()} == {
        "train": list(range(40)),
        "test": list(range(20)),
    }
    assert set(tables["test"]["split"].to_pylist()) == {"test"}


@pytest.mark.parametrize("workers", [1, 2])
def test_worker_processes_give_the_same_content(tables, tmp_path, workers):
    with worker_pool(workers) as executor:
        assert content_hash(sample(SPEC, Factory(), tmp_path, executor, quiet=True)) == content_hash(tables)


def test_only_missing_shards_are_solved_again(tables, tmp_path):
    in_process(tmp_path)
    files = {file: file.stat().st_mtime_ns for file in tmp_path.glob("*.parquet")}
    lost = tmp_path / "shard-00002.parquet"
    lost.unlink()
    assert content_hash(in_process(tmp_path)) == content_hash(tables)
    assert [file for file, made in files.items() if file.stat().st_mtime_ns != made] == [lost]


def test_the_skeleton_and_the_shards_only_change_the_digits_below_the_tolerance(tables, tmp_path):
    other = in_process(tmp_path, SPEC.model_copy(update={"skeleton": 3, "shard": 60}))
    for name in ("delta_a", "W"):
        before, after = (np.stack(found["train"][name].to_pylist()) for found in (tables, other))
        np.testing.assert_allclose(after, before, atol=1e-8)


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT])
def test_killed_or_interrupted_the_next_run_ends_with_the_same_content_and_no_worker_is_left(tables, tmp_path, how):
    script = tmp_path / "child.py"
    script.write_text(CHILD.format(tests=str(Path(__file__).parents[1])))
    run = subprocess.Popen([sys.executable, script, tmp_path / "work"], stderr=subprocess.PIPE, start_new_session=True)
    wait_for(lambda: len(list((tmp_path / "work").glob("shard-*.parquet"))) >= 2)
    workers = children(run.pid)
    assert len(workers) >= 2
    run.send_signal(how)
    run.communicate(timeout=5)
    wait_for(lambda: not any(Path(f"/proc/{worker}").exists() for worker in workers))
    finished = list((tmp_path / "work").glob("shard-*.parquet"))
    assert run.returncode != 0 and len(finished) < 8
    assert content_hash(in_process(tmp_path / "work")) == content_hash(tables)


def test_a_worker_that_dies_is_said_and_what_is_finished_stays(tmp_path):
    class Dying(ThreadPoolExecutor):
        def submit(self, function, *arguments):
            if function.__name__ == "solve_shard" and arguments[1] == 3:
                raise BrokenProcessPool
            return super().submit(function, *arguments)

    with Dying(1) as executor, pytest.raises(CfemError, match="a worker process died"):
        sample(SPEC, Factory(), tmp_path, executor, quiet=True)
    assert (tmp_path / "skeleton.parquet").exists()


def test_workers_compute_on_one_thread_and_the_environment_is_put_back():
    before = dict(os.environ)
    with worker_pool(1) as executor:
        assert executor.submit(os.getenv, "OMP_NUM_THREADS").result() == "1"
    assert dict(os.environ) == before


def children(pid: int) -> list[int]:
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def wait_for(condition, seconds=20.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.02)
