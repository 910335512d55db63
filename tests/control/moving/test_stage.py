"""`cfem control` of a robot that moves between ticks, from YAML to the table."""

import shutil
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from cfem.control.spec import ControlSpec
from cfem.control.stage import run
from cfem.core.errors import InputError, SpecError
from cfem.core.spec import load_spec
from cfem.core.stage import Options
from cfem.robot import stage as mesh_stage
from cfem.sample.stage import run as sample
from cfem.surrogate.stage import run as train

PIPELINE = Path(__file__).parents[3] / "pipelines" / "bar"
QUIET = Options(quiet=True)
SAMPLES = ["splits.train.rows=10", "splits.test.rows=2", "skeleton=3", "skin=null", "dynamics=true"]
SPEC = """
scene: scene.yaml
mesh: ../../data/bar/mesh
models: {spectral: ../../models/bar/spectral}
out: ../../data/bar/control
trajectories:
  eight: {kind: image, shape: figure-eight, centre: [0.4], radii: [0.2], goals: 12}
loop:
  rate: 250 Hz
  command: {kind: force}
  moving: {substeps: 2}
  laps: {speeds: [10 Hz], run_up: 20 ms}
  controllers:
    static: {mode: open}
    shaped: {mode: closed, gains: {integral: 0.05}, shaping: {kind: zvd, modes: 2}}
    computed: {mode: open, feedforward: true}
    mpc: {mode: closed, mpc: {horizon: 10, obstacles: [{point: {mm: [0, 0, -50]}, normal: [0, 0, 1]}]}}
  settle: {radius: 0.5 mm, hold: 4 ms}
  sensor: {noise: 0.02 mm, delay: 1}
  real: {scene: ["material.young=1.1 MPa"]}
"""


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    root = tmp_path_factory.mktemp("bar")
    pipeline = shutil.copytree(PIPELINE, root / "pipelines" / "bar")
    scene = pipeline / "scene.yaml"
    heavy = "material: {young: 1 MPa, poisson: 0.45, density: 1070 kg/m^3, viscosity: {relaxation: 3 ms}}"
    text = scene.read_text().replace("material: {young: 1 MPa, poisson: 0.45}", heavy)
    scene.write_text(text.replace("size: 8 mm", "size: 12 mm\n  element: tet4"))
    (pipeline / "moving.yaml").write_text(SPEC)
    mesh_stage.run(scene, [], None, QUIET)
    sample(pipeline / "sample.yaml", SAMPLES, None, QUIET, workers=1)
    train(pipeline / "train.yaml", ["samples=null"], None, QUIET)
    return root


def control(root, out, *overrides):
    return run(root / "pipelines" / "bar" / "moving.yaml", list(overrides), out, QUIET)["results"]


def test_a_lap_in_finite_elements_that_move(root, tmp_path):
    results = control(root, tmp_path / "out")
    found = results["loop"]["eight at 10 Hz"]
    assert list(found) == ["static", "shaped", "computed", "mpc"]
    assert found["mpc"]["error"]["mean"] < 0.5 * found["static"]["error"]["mean"]
    assert all(one["ticks"] == 30 and one["goals"] == 25 and one["no_position"] == 0 for one in found.values())
    assert [part["until"] for part in found["mpc"]["over_time"]][-1] == pytest.approx(0.12)
    table = pq.read_table(tmp_path / "out" / "loop.parquet").to_pylist()
    mpc = [row for row in table if row["controller"] == "mpc"]
    assert len(mpc) == 30 and {row["status"] for row in mpc} == {"converged"}
    begin = [row["x_e"] for row in table if row["tick"] == 1 and row["controller"] in ("static", "mpc")]
    assert np.ptp(begin, axis=0).max() < 0.3  # both stood still before they began


def test_what_saturates_is_told(root, tmp_path):
    bound = "loop.command={kind: force, largest: 20 N, step: 0.02 N}"
    results = control(root, tmp_path / "out", bound, "loop.controllers={mpc: {mode: open, mpc: {}}}")
    saturated = results["loop"]["eight at 10 Hz"]["mpc"]["saturated"]
    assert saturated["cable: rate"] > 0.1
    assert "cable: rate in" in " ".join(results["headline"])


def test_a_model_that_has_not_learned_to_move_says_so(root, tmp_path):
    still = shutil.copytree(root / "models" / "bar" / "spectral", tmp_path / "still")
    (still / "motion.npz").unlink()
    with pytest.raises(InputError, match="has not learned to move"):
        control(root, tmp_path / "out", f"models.spectral={still}")


@pytest.mark.parametrize(
    "override, what",
    [
        ("loop.controllers.mpc.shaping={}", "one of shaping"),
        ("loop.controllers.mpc.gains={integral: 0.1}", "neither gains"),
        ("loop.controllers.computed.mode=closed", "feedforward is of mode"),
        ("loop.goal_every=1 s", "leave out goal_every"),
        ("loop.real.wall={point: {mm: [0, 0, 0]}, normal: [0, 0, 1]}", "wall does not go with moving"),
        ("loop.real.viscosity=1.2", "needs plant: model"),
        ("loop.laps.speeds=[]", "needs 1 or more"),
    ],
)
def test_what_does_not_go_together_says_so(root, override, what):
    with pytest.raises(SpecError, match=what):
        load_spec(root / "pipelines" / "bar" / "moving.yaml", ControlSpec, [override])
