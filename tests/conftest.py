"""What all tests share. One thread per process: pytest-xdist fills the cores, and threads that wait only waste
them."""

import os

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"))

import shutil
from pathlib import Path

import pytest

import cfem

BAR = Path(__file__).parents[1] / "pipelines" / "bar"


@pytest.fixture(scope="session")
def bar(tmp_path_factory):
    """A project with the bar's mesh (hexahedra: no gmsh), its samples and its spectral model."""
    project = tmp_path_factory.mktemp("project")
    specs = shutil.copytree(BAR, project / "pipelines" / "bar")
    scene = specs / "scene.yaml"
    scene.write_text(
        scene.read_text().replace("size: 8 mm", "{size: 5 mm, element: hex8}").replace("mesh:\n  ", "mesh: ")
    )
    cfem.run_stage("mesh", scene)
    cfem.run_stage("sample", specs / "sample.yaml", workers=1)
    cfem.run_stage("train", specs / "train.yaml")
    return project


@pytest.fixture(scope="session")
def bar_of_any_material(bar, tmp_path_factory):
    """Folder of the bar's spectral model with Poisson's ratio, sampled, and Young's modulus, exact, as parameters."""
    folder, specs = tmp_path_factory.mktemp("material"), bar / "pipelines" / "bar"
    asked = (
        "parameters={poisson: {key: material.poisson, range: [0.30, 0.45]}, "
        "young: {key: material.young, range: {MPa: [0.5, 4]}}}"
    )
    sample = [asked, "splits={train: {rows: 24, method: random, seed: 1}, test: {rows: 4, method: random, seed: 2}}"]
    cfem.run_stage("sample", specs / "sample.yaml", out=folder / "samples", overrides=sample, workers=1)
    cfem.run_stage("train", specs / "train.yaml", out=folder / "model", overrides=[f"dataset={folder / 'samples'}"])
    return folder / "model"
