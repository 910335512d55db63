"""A bar whose model has learned to move, on disk."""

import shutil
from pathlib import Path

import pytest

from cfem.core.stage import Options
from cfem.robot import stage as mesh_stage
from cfem.sample.stage import run as sample
from cfem.surrogate.stage import run as train

PIPELINE = Path(__file__).parents[2] / "pipelines" / "bar"
QUIET = Options(quiet=True)
SAMPLES = ["splits.train.rows=10", "splits.test.rows=2", "skeleton=3", "skin=null", "dynamics=true"]


@pytest.fixture(scope="session")
def root(tmp_path_factory):
    root = tmp_path_factory.mktemp("bar")
    pipeline = shutil.copytree(PIPELINE, root / "pipelines" / "bar")
    scene = pipeline / "scene.yaml"
    heavy = "material: {young: 1 MPa, poisson: 0.45, density: 1070 kg/m^3, viscosity: {relaxation: 3 ms}}"
    scene.write_text(scene.read_text().replace("material: {young: 1 MPa, poisson: 0.45}", heavy))
    scene.write_text(scene.read_text().replace("size: 8 mm", "size: 12 mm\n  element: tet4"))
    mesh_stage.run(scene, [], None, QUIET)
    sample(pipeline / "sample.yaml", SAMPLES, None, QUIET, workers=1)
    train(pipeline / "train.yaml", ["samples=null"], None, QUIET)
    return root
