"""`cfem control` of a robot that moves between ticks, from YAML to the table."""

import json
import shutil
import sys

import numpy as np
import pyarrow.parquet as pq
import pytest

from cfem.control.spec import ControlSpec
from cfem.control.stage import run
from cfem.core.errors import InputError, SpecError
from cfem.core.spec import load_spec
from cfem.core.stage import Options
from cfem.predict.load import load_model

QUIET = Options(quiet=True)
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
def root(moving_bar):
    (moving_bar / "pipelines" / "bar" / "moving.yaml").write_text(SPEC)
    return moving_bar


ESTIMATE = """{markers: {a: {mm: [12, -5, -5]}, b: {mm: [48, 5, 5]}, c: {mm: [60, -5, 5]}, d: {mm: [36, 5, -5]}},
 noise: 0.05 mm, lost: 0.05, loads: {rows: [tip.y, tip.z], largest: 10 mN, lasts: 50 ms}}"""


ADAPTING = "{adapting: {mode: closed, adapt: {noise: 0.1 mm}}}"


def control(root, out, *overrides):
    return run(root / "pipelines" / "bar" / "moving.yaml", list(overrides), out, QUIET)["results"]


@pytest.mark.slow
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


@pytest.mark.slow
def test_markers_instead_of_the_tip(root, tmp_path):
    """Controllers of a robot that moves, on what the filter on the dynamics makes of markers."""
    bare = "{pi: {mode: closed, gains: {integral: 0.05}}, mpc: {mode: closed, mpc: {horizon: 10}}}"
    overrides = (f"loop.estimate={ESTIMATE}", f"loop.controllers={bare}", "loop.sensor={delay: 1}")
    push = "loop.disturbance={tick: 10, force: {mN: [0, 5, 5]}}"
    found = control(root, tmp_path / "out", *overrides, push)["loop"]["eight at 10 Hz"]
    for one in found.values():
        told = one["estimate"]
        assert told["samples"] == 28 and told["estimated"] >= 27
        assert told["shape"]["median"] < 0.1 and told["covered"] > 0.85
        assert 0.5 < told["innovation"] < 2.0
    assert found["mpc"]["error"]["mean"] < 0.5 * found["pi"]["error"]["mean"]


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (f"loop.controllers={ADAPTING}", "adapt takes the robot to be at rest"),
        ("loop.estimate.actuators={force: 20 mN}", "load cells measure inertia too"),
    ],
)
def test_what_does_not_go_with_a_moving_estimate_is_refused(root, tmp_path, wrong, said):
    with pytest.raises(SpecError, match=said):
        control(root, tmp_path / "out", f"loop.estimate={ESTIMATE}", "loop.sensor={delay: 1}", wrong)


def test_what_saturates_is_told(root, tmp_path):
    bound = "loop.command={kind: force, largest: 20 N, step: 0.02 N}"
    results = control(root, tmp_path / "out", bound, "loop.controllers={mpc: {mode: open, mpc: {}}}")
    saturated = results["loop"]["eight at 10 Hz"]["mpc"]["saturated"]
    assert saturated["cable: rate"] > 0.1
    assert "largest change of cable in" in " ".join(results["headline"])


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


DEVICE = """
import json, sys
import numpy as np
from pathlib import Path
from cfem.predict.load import load_model
from cfem.predict.estimation.markers import on_triangles

model = load_model(Path(sys.argv[1]))
places = {"a": [12, -5, -5], "b": [48, 5, 5], "c": [60, -5, 5], "d": [36, 5, -5]}
weights, _ = on_triangles(np.array(list(places.values())), model.skin.rest, model.skin.triangles)
for line in sys.stdin:
    message = json.loads(line)
    if "bye" in message:
        break
    if "hello" in message:
        print(json.dumps({"ready": True, "version": 1}), flush=True)
        continue
    seen = weights @ model.shape(np.array(message["u"]))
    print(json.dumps({"t": message["t"], "markers": dict(zip(places, seen.tolist()))}), flush=True)
"""


def test_a_device_that_moves_is_known_by_its_markers(root, tmp_path):
    """Behind a pipe the filter on the dynamics is asked for by name: of a robot that stands where it is told."""
    (tmp_path / "device.py").write_text(DEVICE)
    words = [sys.executable, str(tmp_path / "device.py"), str(root / "models" / "bar" / "spectral")]
    device = {"kind": "program", "command": words}
    estimate = ESTIMATE.replace(" lost: 0.05,", " dynamics: {},")
    overrides = ("plant=device", f"loop.device={json.dumps(device)}", f"loop.estimate={estimate}", "loop.sensor={}")
    more = ("loop.command={kind: displacement}", "loop.moving=null", "loop.real={}", "loop.rate=50 Hz")
    model = load_model(root / "models" / "bar" / "spectral")
    goals = [(model.rest_e + model.at_displacement([d]).delta_e).tolist() for d in (2.0, 3.0)]
    points = f"trajectories={{points: {{kind: goals, points: {{mm: {goals}}}}}}}"
    slow = (points, "loop.laps=null", "loop.settle={radius: 0.5 mm, hold: 0.6 s, at_most: 1 s}")
    controllers = "loop.controllers={pi: {mode: closed, gains: {integral: 0.05}}}"
    control(root, tmp_path / "out", *overrides, *more, *slow, controllers)
    table = pq.read_table(tmp_path / "out" / "loop.parquet").to_pylist()
    rows = [row for row in table if row["estimate_of"] and row["tick"] > 20]
    assert len(rows) > 30 and {row["estimate_status"] for row in rows} == {"converged"}
    sent = {row["tick"]: row["command"] for row in table}
    apart = [np.subtract(row["estimated_a"], sent[row["estimate_of"]]) for row in rows]
    assert np.sqrt(np.mean(np.square(apart))) < 0.1
