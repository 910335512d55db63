"""Killed at any moment, sampling goes on from what it had: no row lost, none twice, all digits the same."""

import os
import random
import signal
import time

import pytest
from core.artefact.test_files import quick
from faults.processes import processes
from faults.sampling import PLAN, make, make_as_command, make_quietly
from support.waiting import PATIENCE, wait_for

from cfem.core.artefact.unfinished import partial_folder
from cfem.core.artefact.verify import judge
from cfem.dataset.reader import read_table

__all__ = ["quick"]
DELAY = 0.002  # seconds a row takes at least: time to be killed in


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Content hash of the dataset that nothing interrupts."""
    return make(tmp_path_factory.mktemp("whole") / "out")["content"]


def shards(out):
    """Finished ones -> when they were written."""
    return {path.name: path.stat().st_mtime_ns for path in (partial_folder(out) / "shards").glob("shard-*.parquet")}


@pytest.mark.parametrize("kills", [1, pytest.param(200, marks=pytest.mark.slow)])
def test_killed_at_random_moments_it_ends_with_the_same_content(whole, quick, kills):
    moments = random.Random(kills)
    done = datasets = lost = redone = 0
    begin = time.monotonic()
    child = processes().Process(target=make_quietly, args=(quick / "timed", DELAY))
    child.start()
    child.join()
    longest = time.monotonic() - begin
    reached = set()  # numbers of finished shards at a kill
    while done < kills:
        out = quick / f"data-{datasets}" / "out"
        finished = False
        while not finished and done < kills:
            before = shards(out)
            child = processes().Process(target=make_quietly, args=(out, DELAY))
            child.start()
            child.join(moments.uniform(0.0, longest))
            if child.is_alive():
                os.kill(child.pid, signal.SIGKILL)
                done += 1
            child.join()
            after, finished = shards(out), child.exitcode == 0
            reached.add(len(after))
            if not (partial_folder(out) / "test.parquet").exists() and not out.exists():  # else shards may go
                lost += len(before.keys() - after.keys())
                redone += sum(before[name] != after[name] for name in before.keys() & after.keys())
        assert make(out)["content"] == whole
        for split, ids in PLAN.items():
            assert read_table(out / f"{split}.parquet")["id"].to_pylist() == ids
        assert judge(out).damage == ()
        datasets += 1
    assert (lost, redone) == (0, 0)
    print(f"{done} kills, {datasets} datasets, after {sorted(reached)} shards; {lost} lost, {redone} redone")


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_interrupted_it_says_so_and_goes_on(whole, tmp_path, how):
    out = tmp_path / "out"
    child = processes().Process(target=make_as_command, args=(out, 0.06))
    child.start()
    wait_for(lambda: len(shards(out)) >= 2 or not child.is_alive())
    os.kill(child.pid, how)
    child.join(PATIENCE)
    assert child.exitcode == 130
    before = shards(out)
    assert 2 <= len(before) < 14 and not out.exists()
    assert make(out)["content"] == whole
