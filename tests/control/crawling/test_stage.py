"""`cfem control` of a crawler: from the scene of a leg to the judged walk, on bars of 24 cells."""

from types import SimpleNamespace

import numpy as np
import pyarrow.parquet as pq
import pytest

import cfem
from cfem.control.crawling.stage import _records
from cfem.core.errors import CfemError
from cfem.equilibrium.quasi_static import CONVERGED

SCENE = """
name: leg
out: mesh
length: 30 mm
geometry: {kind: bar, length: 30 mm, width: 10 mm, height: 10 mm}
mesh: {size: 5 mm, element: hex8}
material: {young: 1 MPa, poisson: 0.4, density: 1070 kg/m^3}
fixed:
  - {kind: plane, point: {mm: [0, 0, 0]}, normal: [-1, 0, 0]}
actuators:
  - {kind: cable, name: left, pull_point: {mm: [0, 3, -4]},
     points: {mm: [[10, 3, -4], [28, 3, -4]]}, reach: {mm: [0, 2]}}
  - {kind: cable, name: right, pull_point: {mm: [0, -3, -4]},
     points: {mm: [[10, -3, -4], [28, -3, -4]]}, reach: {mm: [0, 2]}}
effectors:
  - {name: foot, point: {mm: [28, 0, -5]}, radius: 3 mm}
  - {name: body, at: centre-of-mass}
"""
SAMPLE = """
scene: scene.yaml
mesh: mesh
out: samples
loads: true
splits:
  train: {rows: 30, method: scrambled-halton, seed: 1}
  test: {rows: 6, method: random, seed: 2}
"""
TRAIN = "dataset: samples\nout: model\nmodel: {kind: spectral}\n"
CONTROL = """
scene: scene.yaml
mesh: mesh
models: {spectral: model}
out: control
robots:
  - {name: one}
  - {name: two, rotate: {axis: [0, 0, 1], angle: 180 deg}, translate: {mm: [-10, 0, 0]}}
gait:
  base: {centre: {mm: [-5, 0, -0.2]}, half_size: {mm: [5, 8, 5]}, weight: 0.2 N}
  ground: {point: {mm: [0, 0, -5.2]}, normal: [0, 0, 1], friction: 0.6}
  direction: [0, 1, 0]
  mirrored: [two]
  pulls: {mm: [0, 0.5]}
  gravity: 9.81 m/s^2
  steps: 4
  cycles: 2
  evaluations: 12
"""


pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("crawling")
    for name, text in {"scene": SCENE, "sample": SAMPLE, "train": TRAIN, "control": CONTROL}.items():
        (folder / f"{name}.yaml").write_text(text)
    cfem.run_stage("mesh", folder / "scene.yaml")
    cfem.run_stage("sample", folder / "sample.yaml", workers=1)
    cfem.run_stage("train", folder / "train.yaml")
    return folder


def test_the_walk_of_the_model_is_that_of_finite_elements(folder):
    found = cfem.run_stage("control", folder / "control.yaml")["results"]

    planned, fe = (found["per_cycle"][name] for name in ("planned", "fe"))
    assert planned > 0 and fe == pytest.approx(planned, rel=0.05)
    assert found["contact"]["commands"] == 8 and found["contact"]["law_residual"] <= 1e-8
    table = pq.read_table(folder / "control/trajectories.parquet").to_pydict()
    assert len(table["goal"]) == 8 and max(table["error"]) < 0.05
    shapes = np.load(folder / "control/states.npz")
    assert len(shapes["gait/x"]) == 8 and np.isfinite(shapes["gait/x"]).all()


def test_a_model_without_displacements_is_refused(folder):
    (folder / "force.yaml").write_text(
        TRAIN.replace("out: model", "out: force").replace("{kind: spectral}", "{kind: spectral, form: force}")
    )
    cfem.run_stage("train", folder / "force.yaml")
    with pytest.raises(CfemError, match="form displacement"):
        cfem.run_stage("control", folder / "control.yaml", overrides=["models.spectral=force"])


def test_commands_that_the_fe_crawler_did_not_come_to_have_no_place():
    leg = SimpleNamespace(delta_a=np.ones(2), lambda_a=np.ones(2))
    touch = SimpleNamespace(solved=[leg, None], iterations=3, check=SimpleNamespace(largest=1e-9))
    base, commands = np.arange(9.0).reshape(3, 3), [np.ones(2)] * 2
    planned = SimpleNamespace(commands=commands, base=base, touches=[touch] * 2, seconds=[0.1] * 2, status=CONVERGED)
    fe = SimpleNamespace(commands=commands[:1], base=base[:2] + 0.3, status="no balance found")
    model = SimpleNamespace(at_displacement=lambda u: u, inside=lambda state: True, distance=lambda state: 0.5)
    first, second = _records("spectral", planned, fe, 1.0, model)
    assert first["error"] == pytest.approx(np.sqrt(3) * 0.3) and first["reached"]
    assert first["plant_status"] == CONVERGED
    assert np.isnan(second["x_e"]).all() and not second["reached"]
    assert second["plant_status"] == "no balance found"
