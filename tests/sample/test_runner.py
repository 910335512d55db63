"""The dataset is the same whatever the number of workers, their order, and the interruptions."""

import os
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sample.synthetic import Factory
from support.fast_cases import fast_are
from support.waiting import PATIENCE, wait_for
from surrogate import synthetic as closed_form
from surrogate.synthetic import POISSON, YOUNG

from cfem.dataset.reader import read_dataset
from cfem.dataset.writer import content_hash, write_table
from cfem.sample.plan import skeleton
from cfem.sample.processes.pool import worker_pool
from cfem.sample.runner import make_job, merge, sample, solve_rows, solve_skeleton
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
from cfem.sample.processes.pool import worker_pool
from cfem.sample.runner import sample
if __name__ == "__main__":
    with worker_pool(2) as executor:
        sample(SPEC, Factory(delay=0.1), Path(sys.argv[1]), executor)
"""


def in_process(folder, spec=SPEC, factory=None):
    with ThreadPoolExecutor(1) as executor:
        return sample(spec, factory or Factory(), folder, executor)


@pytest.fixture(scope="module")
def tables(tmp_path_factory):
    return in_process(tmp_path_factory.mktemp("whole"))


def test_rows_come_in_the_order_of_their_plan_whatever_the_order_of_work(tables):
    assert {split: table["id"].to_pylist() for split, table in tables.items()} == {
        "train": list(range(40)),
        "test": list(range(20)),
    }
    assert set(tables["test"]["split"].to_pylist()) == {"test"}


@pytest.mark.parametrize("workers", fast_are({2}, [1, 2]))
def test_worker_processes_give_the_same_content(tables, tmp_path, workers):
    with worker_pool(workers) as executor:
        assert content_hash(sample(SPEC, Factory(), tmp_path, executor)) == content_hash(tables)


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


@pytest.mark.parametrize("how", [signal.SIGKILL, pytest.param(signal.SIGINT, marks=pytest.mark.slow)])
def test_killed_or_interrupted_the_next_run_ends_with_the_same_content_and_no_worker_is_left(tables, tmp_path, how):
    script = tmp_path / "child.py"
    script.write_text(CHILD.format(tests=str(Path(__file__).parents[1])))
    run = subprocess.Popen([sys.executable, script, tmp_path / "work"], stderr=subprocess.PIPE, start_new_session=True)
    wait_for(lambda: len(list((tmp_path / "work").glob("shard-*.parquet"))) >= 2)
    workers = children(run.pid)
    assert len(workers) >= 2
    run.send_signal(how)
    run.communicate(timeout=PATIENCE)
    wait_for(lambda: not any(Path(f"/proc/{worker}").exists() for worker in workers))
    finished = list((tmp_path / "work").glob("shard-*.parquet"))
    assert run.returncode != 0 and len(finished) < 8
    assert content_hash(in_process(tmp_path / "work")) == content_hash(tables)


def test_workers_compute_on_one_thread_and_the_environment_is_put_back():
    before = dict(os.environ)
    with worker_pool(1) as executor:
        assert executor.submit(os.getenv, "OMP_NUM_THREADS").result() == "1"
    assert dict(os.environ) == before


PARAMETERS = (POISSON, YOUNG)


def test_rows_of_robots_with_parameters_carry_them(tmp_path):
    spec = SPEC.model_copy(update={"third_order": True})
    tables = in_process(tmp_path, spec, Factory(parameters=PARAMETERS, third_order=True))
    write_table(tmp_path / "train.parquet", tables["train"])
    train = read_dataset(tmp_path / "train.parquet")
    assert train.parameters == (POISSON,) and train.u.shape == (40, 3) and train.p.shape == (40, 1)
    q, ends = np.log(1 - 2 * train.p[:, 0]), np.log(1 - 2 * np.array([POISSON.low, POISSON.high]))
    np.testing.assert_allclose(q, ends[0] + train.u[:, 2] * (ends[1] - ends[0]), rtol=1e-12)
    expected = closed_form.states(train.delta_a, closed_form.stiffer(train.p))
    np.testing.assert_allclose(train.energy, expected["energy"], rtol=1e-12)
    h = 1e-6
    ahead, behind = (closed_form.stiffer(train.p + sign * h) for sign in (1, -1))
    slope = (ahead - behind) / (2 * h) * closed_form.energy(train.delta_a)[0]
    np.testing.assert_allclose(train.dpsi_dp[:, 0], slope, rtol=1e-6, atol=1e-6)
    dW = closed_form.compliance_derivatives(train.delta_a, closed_form.stiffer(train.p))
    np.testing.assert_allclose(train.dW, dW, atol=1e-12)
    assert train.cost["iterations"].mean() < 5  # predicted, across robots


def test_a_plan_grows_by_rows_from_its_skeleton_and_keeps_what_is_solved(tmp_path):
    more = np.random.default_rng(0).random((20, 3))

    def grown(folder, u, extra):
        with ThreadPoolExecutor(1) as executor:
            job = make_job(SPEC, Factory(parameters=PARAMETERS), folder, executor)
            solve_skeleton(job, skeleton(job.u, SPEC.skeleton))
            ids = tuple(range(40, 40 + len(u)))
            added = replace(job, u=u, split=("train",) * len(u), id=ids, folder=folder / extra)
            return merge(solve_rows(added, np.arange(len(u)), 6), ["train"])["train"]

    once = grown(tmp_path / "a", more, "round-1")
    assert once["id"].to_pylist() == list(range(40, 60))
    np.testing.assert_array_equal(np.stack(once["u"].to_pylist()), more)
    files = {file: file.stat().st_mtime_ns for file in (tmp_path / "a" / "round-1").iterdir()}
    (tmp_path / "a" / "round-1" / "shard-00001.parquet").unlink()
    again = grown(tmp_path / "a", more, "round-1")
    assert content_hash({"train": again}) == content_hash({"train": once})
    changed = [file.name for file, made in files.items() if file.stat().st_mtime_ns != made]
    assert changed == ["shard-00001.parquet"]
    elsewhere = grown(tmp_path / "b", more, "other")
    assert content_hash({"train": elsewhere}) == content_hash({"train": once})
    other = grown(tmp_path / "a", more[::-1], "round-1")  # chosen anew: what was solved for other rows does not stand
    np.testing.assert_array_equal(np.stack(other["u"].to_pylist()), more[::-1])


def children(pid: int) -> list[int]:
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def test_a_set_that_grows_has_the_rows_of_one_that_was_made_at_once(tables, tmp_path):
    """Also where one row comes to those that are there, and where none of the new ones converges."""
    old = SPEC.model_copy(update={"splits": {"train": split(SPEC, "train", 30), "test": split(SPEC, "test", 19)}})
    (tmp_path / "old").mkdir()
    for name, table in in_process(tmp_path / "work", old).items():
        write_table(tmp_path / "old" / f"{name}.parquet", table)
    with ThreadPoolExecutor(1) as executor:
        grown = sample(SPEC, Factory(), tmp_path / "more", executor, known=tmp_path / "old")
        failing = sample(SPEC, Factory(fails_beyond=-1.0), tmp_path / "fails", executor, known=tmp_path / "old")
    for name, table in tables.items():
        assert grown[name]["id"].to_pylist() == table["id"].to_pylist()
        for column in ("u", "delta_a", "W", "energy"):
            now, at_once = (np.stack(each[column].to_pylist()) for each in (grown[name], table))
            np.testing.assert_allclose(now, at_once, atol=0 if column == "u" else 1e-8)
    assert failing["train"]["status"].to_pylist() == ["converged"] * 30 + ["step_too_small"] * 10


def split(spec, name, rows):
    return spec.splits[name].model_copy(update={"rows": rows})
