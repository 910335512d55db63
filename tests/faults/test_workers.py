"""Workers that are killed or hang while they solve: the run ends with the same dataset, or names what it cannot do."""

import os
import signal
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from sample.synthetic import FACTS, Factory, SyntheticSolver
from sample.test_runner import SPEC
from support.dask_processes import dask_processes, wait_for

from cfem.dataset.writer import content_hash
from cfem.sample import plan
from cfem.sample.plan import actuation, unit_rows
from cfem.sample.processes import pool
from cfem.sample.processes.pool import with_workers
from cfem.sample.processes.workers import Workers, WorkersLost
from cfem.sample.runner import sample

pytestmark = pytest.mark.usefixtures("processes")


@dataclass(frozen=True)
class Signed(Factory):
    """Every process that solves leaves its id in the folder `names`, and is killed at the state where the pull's amount
    is `deadly` mm, once `others` shards are finished. waits: once two shards are finished, until the file `disturbed`
    is there."""

    names: str = ""
    deadly: float | None = None
    others: int = 0
    waits: bool = False

    def __call__(self):
        (Path(self.names) / str(os.getpid())).touch()
        return Watched(super().__call__(), Path(self.names), self.deadly, self.others, self.waits)


@dataclass(frozen=True)
class Watched:
    solver: SyntheticSolver
    names: Path
    deadly: float | None
    others: int
    waits: bool

    @property
    def facts(self):
        return self.solver.facts

    @property
    def rotation_strain(self):
        return self.solver.rotation_strain

    def roughly(self, pushed=None):
        return self.solver.roughly(pushed)

    def solve(self, actuation, start, p):
        if len(actuation.target) and actuation.target[0] == self.deadly:
            wait_for(lambda: len(shards(self.names.parent / "work")) >= self.others)
            os.kill(os.getpid(), signal.SIGKILL)
        if self.waits and len(shards(self.names.parent / "work")) >= 2:
            wait_for((self.names.parent / "disturbed").exists)
        if (self.names.parent / "pause").exists():  # until another has come
            wait_for(lambda: len(solvers(self.names)) >= 3)
        return self.solver.solve(actuation, start, p)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Content hash of what nothing disturbs."""
    with ThreadPoolExecutor(1) as executor:
        return content_hash(sample(SPEC, Factory(), tmp_path_factory.mktemp("whole"), executor))


@pytest.fixture
def names(tmp_path):
    folder = tmp_path / "names"
    folder.mkdir()
    return folder


def solvers(names):
    return {int(path.name) for path in names.iterdir()}


def shards(work):
    """Finished ones -> when they were written."""
    return {path.name: path.stat().st_mtime_ns for path in work.glob("shard-*.parquet")}


def disturbed(workers, names, work, disturb):
    """The tables, while `disturb` runs beside, once both workers solve; shards that were finished before it stay."""
    before = {}

    def beside():
        wait_for(lambda: len(shards(work)) >= 2)
        wait_for(lambda: len(solvers(names)) == 2)
        before.update(shards(work))
        disturb()
        (names.parent / "disturbed").touch()

    thread = threading.Thread(target=beside)
    thread.start()
    factory = Signed(0.03, names=str(names), waits=True)
    tables = with_workers(workers, lambda one: sample(SPEC, factory, work, one, timeout=workers.timeout))
    thread.join()
    after = shards(work)
    assert {name: after[name] for name in before} == before, "finished shards were solved again"
    return tables


@pytest.mark.parametrize(
    "how, timeout", [(signal.SIGKILL, None), pytest.param(signal.SIGSTOP, 6.0, marks=pytest.mark.slow)]
)
def test_a_process_that_is_killed_or_stopped_is_replaced(whole, names, tmp_path, capfd, how, timeout):
    lost = []

    def disturb():
        lost.append(min(solvers(names)))
        os.kill(lost[0], how)

    tables = disturbed(Workers(2, timeout=timeout), names, tmp_path / "work", disturb)
    assert content_hash(tables) == whole
    said = capfd.readouterr().err
    assert said.count("going on with fresh workers") == 1 and ("died" in said) == (how == signal.SIGKILL)
    assert not Path(f"/proc/{lost[0]}").exists() and len(solvers(names)) > 2


def deadly(names):
    """A robot that dies at a row of the fifth shard, and the number of shards."""
    u = np.concatenate([unit_rows(split, 2) for split in SPEC.splits.values()])
    rest = np.setdiff1d(np.arange(len(u)), plan.skeleton(u, SPEC.skeleton))
    pieces = plan.shards(u, rest, SPEC.shard)
    asked = actuation(SPEC.space, u[pieces[4][2]], FACTS.reach, FACTS.compliance)
    return Signed(names=str(names), deadly=float(asked.target[0]), others=len(pieces) - 1), len(pieces)


def test_a_state_that_kills_every_process_is_named_and_what_others_finish_is_kept(names, tmp_path, capfd, monkeypatch):
    monkeypatch.setattr(pool, "FRESH", 1)
    factory, count = deadly(names)
    with pytest.raises(WorkersLost, match=r"a worker died; unfinished: shard-00004.parquet \("):
        with_workers(Workers(2), lambda one: sample(SPEC, factory, tmp_path / "work", one))
    assert len(shards(tmp_path / "work")) == count - 1
    assert capfd.readouterr().err.count("fresh workers") == 1


@pytest.mark.slow
def test_dask_workers_are_killed_and_join_during_the_run(whole, names, tmp_path):
    with dask_processes(tmp_path) as processes:
        first, _ = processes.worker(), processes.worker()
        processes.wait_for_workers(2)

        def disturb():
            (tmp_path / "pause").touch()
            processes.kill(first)
            processes.worker()

        tables = disturbed(Workers(scheduler=processes.address), names, tmp_path / "work", disturb)
        assert content_hash(tables) == whole
        assert len(solvers(names)) == 3


@pytest.mark.slow
def test_a_dask_worker_that_is_stopped_is_left_by_dask(whole, names, tmp_path):
    with dask_processes(tmp_path, DASK_DISTRIBUTED__SCHEDULER__WORKER_TTL="2s") as processes:
        first, _ = processes.worker(), processes.worker()
        processes.wait_for_workers(2)
        tables = disturbed(
            Workers(scheduler=processes.address),
            names,
            tmp_path / "work",
            lambda: os.killpg(first.pid, signal.SIGSTOP),
        )
        assert content_hash(tables) == whole


@pytest.mark.slow
def test_a_state_that_kills_dask_workers_is_given_up(names, tmp_path):
    with dask_processes(tmp_path, DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES="1") as processes:
        processes.worker()
        factory = replace(deadly(names)[0], others=0)  # the only worker cannot finish others meanwhile
        said = "2 Dask workers died of one shard, the last at tcp://127.0.0.1"
        with pytest.raises(WorkersLost, match=said):
            with_workers(
                Workers(scheduler=processes.address),
                lambda one: sample(SPEC, factory, tmp_path / "work", one),
            )
        assert len(shards(tmp_path / "work")) >= 4
