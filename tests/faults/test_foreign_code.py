"""What lies in the working folder is data: no process of ours takes a module from there, and none outlives us."""

import json
import os
import subprocess
import sys

import pytest
from support.waiting import PATIENCE

from cfem.robot.cad import Box, as_data
from cfem.robot.mesh.meshing import measure
from cfem.sample.processes.pool import worker_pool

MODULES = ("gmsh", "json", "numpy", "threading", "signal", "pickle", "multiprocessing")


@pytest.fixture
def trapped(tmp_path, monkeypatch):
    """A working folder whose modules leave a mark when they are executed."""
    for name in MODULES:
        (tmp_path / f"{name}.py").write_text(f"open({str(tmp_path / 'executed')!r}, 'a').write('{name} ')\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.usefixtures("anew")
def test_the_process_of_gmsh_takes_no_module_from_the_working_folder(trapped):
    assert measure(Box((0, 0, 0), (1, 2, 3))) == pytest.approx((6.0, 22.0))
    assert not (trapped / "executed").exists()


def test_workers_take_no_module_from_the_working_folder(trapped):
    with worker_pool(1) as executor:
        assert executor.submit(os.getcwd).result() == str(trapped)
    assert not (trapped / "executed").exists()


def test_gmsh_ends_with_the_process_that_waits_for_it(tmp_path):
    """The parent's end, however it comes, closes the pipe to gmsh's process, which has a mesh of hours to make."""
    command = [sys.executable, "-m", "cfem.robot.mesh.gmsh_process", tmp_path / "job.json", tmp_path / "mesh.npz"]
    job = {
        "solid": as_data(Box((0, 0, 0), (100, 100, 100))),
        "size": 0.1,
        "refine": [],
        "regions": [],
        "max_cells": 1e12,
        "factor": 1.0,
        "around": 0,
        "patience": 1,
    }
    (tmp_path / "job.json").write_text(json.dumps(job))
    with subprocess.Popen(command, stdin=subprocess.PIPE) as process:
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(timeout=1)
        process.stdin.close()
        assert process.wait(timeout=PATIENCE) == 12
