"""An interrupted control run goes on from the goals that it has finished, to the figures of an uninterrupted one."""

import errno
import io
import os
import pickle
import shutil
from types import SimpleNamespace

import numpy as np
import pytest
from support.cut_short import cut_short, demand_equal
from support.fast_cases import fast_are

import cfem
from cfem.control.open_loop import resume
from cfem.control.open_loop.resume import FILE, KeptRun, _Reader
from cfem.core.artefact.files import write_whole
from cfem.core.artefact.manifest import read_manifest
from cfem.core.errors import OutputError
from cfem.plant.fem_plant import FemPlant

SWING = [
    "trajectories={swing: {kind: image, centre: [0.5], radii: [0.4], goals: 3}, "
    "there: {kind: goals, points: {mm: [[58.9, 0, 1.5], [58.8, 0, 1.8]]}}}",
    "models={spectral: ../../models/bar/spectral}",
    "mesh_error={states: 1}",
]
TRACKED = [*SWING[:-1], "mesh_error=null"]  # the mesh's error takes longer than the goals


@pytest.fixture(scope="module")
def swing(bar):
    """Its spec, and the output of a run that nothing befell."""
    spec = bar / "pipelines" / "bar" / "control.yaml"
    whole = bar / "whole"
    cfem.run_stage("control", spec, overrides=SWING, out=whole)
    return spec, whole


@pytest.fixture(scope="module")
def unfinished(swing, tmp_path_factory):
    """Work of a run of `TRACKED` that was cut short after two goals, cut once, and copied beside `out`."""
    folder = tmp_path_factory.mktemp("cut")
    cut_short(swing[0], 2, overrides=TRACKED, out=folder / "cut")

    def unfinished(out):
        shutil.copytree(folder, out.parent, dirs_exist_ok=True)
        return out

    return unfinished


@pytest.mark.parametrize("after", [2, pytest.param(5, marks=pytest.mark.slow)])
def test_interrupted_it_ends_with_the_same_figures(swing, tmp_path, capfd, monkeypatch, after):
    spec, whole = swing
    cut = tmp_path / "cut"
    cut_short(spec, after, overrides=SWING, out=cut)
    capfd.readouterr()
    solved = count_solves(monkeypatch)
    again = cfem.run_stage("control", spec, overrides=SWING, out=cut)
    demand_equal(whole, cut)
    assert (
        f"control: going on after {after} of 5 goals, which an interrupted run has finished\n" in capfd.readouterr().err
    )
    assert {path.name for path in cut.iterdir()} == {"manifest.json", "states.npz", "trajectories.parquet"}
    results = read_manifest(whole)["results"]
    assert again["results"]["discretisation"] == results["discretisation"]
    # the cost is that of both runs; the second one's own is what was left to do
    assert again["results"]["fe_cost"]["solves"] == results["fe_cost"]["solves"] >= len(solved) + 2 * after


def count_solves(monkeypatch):
    solve, solved = FemPlant._solve, []

    def counted(self, *arguments, **more):
        solved.append(1)
        return solve(self, *arguments, **more)

    monkeypatch.setattr(FemPlant, "_solve", counted)
    return solved


@pytest.mark.slow
def test_interrupted_twice(swing, tmp_path):
    spec, whole = swing
    for after in (1, 3):
        cut_short(spec, after, overrides=SWING, out=tmp_path / "cut")
    cfem.run_stage("control", spec, overrides=SWING, out=tmp_path / "cut")
    demand_equal(whole, tmp_path / "cut")


def test_of_other_goals_it_starts_over(swing, unfinished, tmp_path, capfd):
    other = [*TRACKED, "trajectories.swing.goals=1"]
    found = cfem.run_stage("control", swing[0], overrides=other, out=unfinished(tmp_path / "cut"))
    assert found["results"]["trajectories"]["swing"]["spectral"]["goals"] == 1
    assert "going on" not in capfd.readouterr().err


@pytest.mark.parametrize("keep", fast_are({0.9}, [0.0, 0.9]))
def test_a_damaged_file_is_said_and_left(swing, unfinished, tmp_path, capfd, keep):
    spec, whole = swing
    unfinished(tmp_path / "cut")
    file = tmp_path / ".cut.partial" / FILE
    os.truncate(file, int(keep * file.stat().st_size))
    cfem.run_stage("control", spec, overrides=TRACKED, out=tmp_path / "cut")
    demand_equal(whole, tmp_path / "cut")
    said = capfd.readouterr().err
    assert f"{FILE}: what an interrupted run kept cannot be used (it is damaged): starting over\n" in said


def test_a_full_disk_ends_the_keeping_and_not_the_run(swing, tmp_path, capfd, monkeypatch):
    spec, whole = swing

    def full(path, data):
        if path.name == FILE:
            raise OutputError(os.strerror(errno.ENOSPC), where=str(path))
        write_whole(path, data)

    monkeypatch.setattr(resume, "write_whole", full)
    monkeypatch.setattr(resume, "EVERY", 0.0)
    cfem.run_stage("control", spec, overrides=TRACKED, out=tmp_path / "out")
    demand_equal(whole, tmp_path / "out")
    said = capfd.readouterr().err
    assert said.count("No space left on device") == 1 and "after an interruption this run starts over" in said


def test_a_state_that_cannot_be_kept_is_said_once(tmp_path, capfd, monkeypatch):
    monkeypatch.setattr(resume, "EVERY", 0.0)
    plant = SimpleNamespace(problems=[], memory=lambda: None)
    plant.changing = [(plant, ("memory",))]
    run = KeptRun(tmp_path)
    run.begin([plant], {"there": np.zeros((2, 3))})
    run.finished("there", None)
    assert capfd.readouterr().err.count("the state of this plant cannot be kept") == 1
    assert list(tmp_path.iterdir()) == []


class Harm:
    def __reduce__(self):
        return os.mkdir, ("harm",)


@pytest.mark.parametrize("harm", [Harm(), FemPlant, write_whole, np.save])
def test_a_file_that_calls_for_more_than_values_is_refused(tmp_path, monkeypatch, harm):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(pickle.UnpicklingError, match="is no value of cfem"):
        _Reader(io.BytesIO(pickle.dumps(harm)), []).load()
    assert list(tmp_path.iterdir()) == []
