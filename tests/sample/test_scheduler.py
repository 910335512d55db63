"""The workers of a Dask cluster give the dataset that local processes give, or one clear error."""

import shutil
import signal
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from sample.test_runner import SPEC, in_process
from support.dask_processes import dask_processes
from support.waiting import PATIENCE, wait_for
from typer.testing import CliRunner

from cfem.cli.app import app
from cfem.core.artefact.manifest import read_manifest
from cfem.core.errors import InputError, SpecError
from cfem.dataset.writer import content_hash
from cfem.robot.load import load_scene_and_mesh
from cfem.sample.processes import cluster
from cfem.sample.processes.pool import with_workers, worker_pool
from cfem.sample.processes.workers import Workers, WorkersLost
from cfem.sample.runner import sample
from cfem.sample.solver import FiniteElements

PIPELINE = Path(__file__).parents[2] / "pipelines" / "bar"
SMALL = [f"--set={text}" for text in ("splits.train.rows=6", "splits.test.rows=3", "skeleton=4", "shard=3")]
CHILD = """
import sys
from pathlib import Path
from sample.synthetic import Factory
from sample.test_runner import SPEC
from cfem.cli.run import run_command
from cfem.sample.processes.pool import with_workers
from cfem.sample.processes.workers import Workers
from cfem.sample.runner import sample
folder, address = Path(sys.argv[1]), sys.argv[2]
def work(options):
    with_workers(Workers(scheduler=address), lambda executor: sample(SPEC, Factory(0.1), folder, executor))
run_command(work)
"""


@pytest.fixture(scope="module")
def dask(tmp_path_factory):
    """A scheduler with one worker."""
    with dask_processes(tmp_path_factory.mktemp("dask")) as processes:
        processes.worker()
        yield processes


@pytest.fixture(scope="module")
def bar(tmp_path_factory):
    """Its pipeline, with a mesh."""
    pipeline = shutil.copytree(PIPELINE, tmp_path_factory.mktemp("bar") / "pipelines" / "bar")
    assert cfem("mesh", pipeline / "scene.yaml").exit_code == 0
    return pipeline


def cfem(*words):
    return CliRunner().invoke(app, [*map(str, words), "--quiet"])


@pytest.mark.slow
def test_finite_elements_give_the_same_content(dask, bar, processes, tmp_path):
    for name, option, value in (("local", "--workers", 2), ("dask", "--scheduler", dask.address)):
        found = cfem("sample", bar / "sample.yaml", *SMALL, "--out", tmp_path / name, option, value)
        assert found.exit_code == 0, found.stderr
    local, remote = (read_manifest(tmp_path / name) for name in ("local", "dask"))
    assert remote["content"] == local["content"] and remote["made_from"] == local["made_from"]


@pytest.mark.slow
def test_workers_need_no_file_of_the_machine_that_asks(dask, bar, tmp_path):
    pipeline = shutil.copytree(bar, tmp_path / "scene")
    mesh = shutil.copytree(bar.parents[1] / "data" / "bar" / "mesh", tmp_path / "mesh")
    factory = FiniteElements(*load_scene_and_mesh(pipeline / "scene.yaml", mesh), 1e-10)
    shutil.rmtree(pipeline), shutil.rmtree(mesh)
    spec = SPEC.model_copy(update={"splits": {"test": SPEC.splits["test"].model_copy(update={"rows": 4})}})
    here, there = tmp_path / "here", tmp_path / "there"
    remote = with_workers(Workers(scheduler=dask.address), lambda one: sample(spec, factory, there, one))
    with worker_pool(1) as executor:
        assert content_hash(remote) == content_hash(sample(spec, factory, here, executor))


@pytest.mark.slow
def test_large_arguments_are_sent_without_a_warning(dask):
    with cluster.cluster(dask.address) as executor:
        large = bytes(30_000_000)
        assert [executor.submit(len, large).result(timeout=PATIENCE) for _ in range(2)] == [len(large)] * 2


def child(folder, address):
    words = [sys.executable, "-c", CHILD, folder / "work", address]
    environment = {"PYTHONPATH": str(Path(__file__).parents[1])}
    run = subprocess.Popen(words, stderr=subprocess.PIPE, text=True, env=environment)
    wait_for(lambda: len(list((folder / "work").glob("shard-*.parquet"))) >= 2)
    return run


def test_interrupted_it_withdraws_what_waits_and_goes_on(dask, tmp_path):
    from distributed import Client

    run = child(tmp_path, dask.address)
    run.send_signal(signal.SIGINT)
    _, said = run.communicate(timeout=PATIENCE)
    assert (
        run.returncode == 130
        and said == "cfem: interrupted; finished stages, samples and goals are kept: run the same command again\n"
    )
    with Client(dask.address, set_as_default=False) as client:
        wait_for(lambda: client.run_on_scheduler(lambda dask_scheduler: not dask_scheduler.tasks))
    assert 2 <= len(list((tmp_path / "work").glob("shard-*.parquet"))) < 8
    assert content_hash(in_process(tmp_path / "work")) == content_hash(in_process(tmp_path / "whole"))


@pytest.mark.slow
def test_a_scheduler_that_ends_is_said_and_what_is_finished_stays(tmp_path):
    with dask_processes(tmp_path) as processes:
        processes.worker()
        run = child(tmp_path, processes.address)
        processes.kill(processes.scheduler)
        _, said = run.communicate(timeout=PATIENCE)
    assert run.returncode == 4 and len(said.splitlines()) == 1 and "scheduler" in said and "is gone" in said
    assert content_hash(in_process(tmp_path / "work")) == content_hash(in_process(tmp_path / "whole"))


def test_no_scheduler_is_said(bar, tmp_path, monkeypatch):
    monkeypatch.setattr(cluster, "_CONNECT", "1s")
    for address in ("tcp://127.0.0.1:1", "nowhere.invalid:8786", "gopher://127.0.0.1:1"):
        words = ("sample", bar / "sample.yaml", "--out", tmp_path / "out", "--scheduler", address)
        found = cfem(*words)
        assert found.exit_code == 2 and f"no Dask scheduler answers at {address}" in found.stderr
    assert "leave one of them out" in cfem(*words, "--workers", 2).stderr


@pytest.mark.slow
def test_a_cluster_without_workers_is_said_after_the_timeout(tmp_path):
    with dask_processes(tmp_path) as processes, pytest.raises(WorkersLost, match=r"for 0.5 s; unfinished: facts"):
        workers = Workers(scheduler=processes.address, timeout=0.5)
        with_workers(workers, lambda one: sample(SPEC, None, tmp_path, one, timeout=workers.timeout))


@pytest.mark.slow
def test_workers_that_lack_cfem_are_said(tmp_path):
    block = tmp_path / "block.py"
    block.write_text("import sys\nsys.modules['cfem'] = None\n")
    with (
        dask_processes(tmp_path) as processes,
        pytest.raises(InputError, match=r"worker tcp://.*: cannot run cfem: ModuleNotFoundError"),
    ):
        processes.worker("--preload", str(block))
        processes.wait_for_workers(1)
        with_workers(Workers(scheduler=processes.address), lambda executor: None)


def test_a_worker_that_would_round_otherwise_refuses(monkeypatch):
    worker = SimpleNamespace(address="tcp://other:1", state=SimpleNamespace(nthreads=1))
    monkeypatch.setattr("distributed.get_worker", lambda: worker)
    for name in cluster.THREADS:
        monkeypatch.setenv(name, "1")
    here = cluster.local_versions()
    assert cluster._alike(here, max, 1, 2) == 2
    with pytest.raises(InputError, match=r"tcp://other:1: has other versions: numpy [\d.]+ in place of 1.0"):
        cluster._alike(here | {"numpy": "1.0"}, max, 1, 2)
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "2")
    with pytest.raises(InputError, match="several threads"):
        cluster._alike(here, max, 1, 2)
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "1")
    worker.state.nthreads = 4
    with pytest.raises(InputError, match="--nthreads 1"):
        cluster._alike(here, max, 1, 2)


def test_without_dask_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(SpecError, match=r"cfem\[cluster\]"):
        with_workers(Workers(scheduler="tcp://127.0.0.1:1"), lambda executor: None)
