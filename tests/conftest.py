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
