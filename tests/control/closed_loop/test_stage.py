"""The loop part of the spec, from YAML to the table: a model as the plant, and a device behind a pipe."""

import json
import os
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pyarrow.parquet as pq
import pytest
from export.wired import firmware, on_a_serial_port
from support.blocks import bar
from surrogate.stored import train_folder

from cfem.condensed.strokes import ridge_of
from cfem.control.closed_loop.stage import run_controllers
from cfem.control.closed_loop.tick import Pilot
from cfem.control.search.goal_search import SearchSettings
from cfem.control.search.inverse import Limits
from cfem.control.spec import ControlSpec
from cfem.core.errors import InputError, SpecError
from cfem.core.spec import load_spec
from cfem.plant.fem_plant import FemPlant, pushed
from cfem.plant.gains import integral_for
from cfem.plant.model_plant import ModelPlant
from cfem.predict.load import load_model, read_model

SPEC = """
scene: scene.yaml
mesh: mesh
models: {spectral: model}
out: out
plant: model
trajectories:
  points: {kind: goals, points: {mm: [[0, 0, 0]]}}
loop:
  rate: 50 Hz
  command: {kind: force}
  controllers:
    open: {mode: open}
    closed: {mode: closed}
    paper: {mode: closed, observer: previous_step, gains: {proportional: 0.01, integral: 0.002}}
  settle: {radius: 0.3 mm, hold: 0.2 s, at_most: 1 s}
  sensor: {noise: 0.02 mm, delay: 1}
  real: {stiffer: 1.1}
  seeds: [1, 2]
"""


@pytest.fixture(scope="module")
def model_folder(tmp_path_factory):
    return train_folder(tmp_path_factory.mktemp("loop"), "{kind: spectral, max_degree: 10}", train=60)


def load(tmp_path, *overrides) -> ControlSpec:
    path = tmp_path / "control.yaml"
    path.write_text(SPEC)
    return load_spec(path, ControlSpec, overrides)


def control(folder: Path, spec: ControlSpec, model_folder: Path, course=1.0, forces=None, lengths=0.0):
    """Results; lengths: of the robot, from where it rests to a goal behind those that it reaches."""
    model = load_model(model_folder)
    unilateral = np.ones(2, dtype=bool)
    robot = SimpleNamespace(
        rows=model.rows,
        rest_e=model.rest_e,
        reach=course * model.reach,
        unilateral=unilateral,
        length=model.length,
        forces=forces,
    )
    goals = np.array([model.rest_e + model.at_displacement(np.array(d)).delta_e for d in ([6.0, 5.0], [9.0, 9.5])])
    if lengths:
        goals = np.vstack([goals, model.rest_e + [0, 0, lengths * model.length]])
    return run_controllers(folder, spec, folder, robot, {"spectral": model}, {"points": goals}, search(robot, model))


def search(robot, model):
    limits, ridge = Limits.of(robot.reach, robot.unilateral), ridge_of(1e-10, robot.reach, robot.length)
    return Pilot(model, "displacement", "equilibrium", limits, np.ones(3), ridge, SearchSettings())


def test_closed_reaches_what_open_misses(tmp_path, model_folder):
    results = control(tmp_path, load(tmp_path), model_folder)
    json.dumps(results, allow_nan=False)
    found = results["loop"]["points"]
    assert found["open"]["reached"]["max"] == 0 and found["closed"]["reached"]["min"] == 2
    assert found["closed"]["ticks_to_converge"]["held"] == 4 and found["closed"]["ticks_to_converge"]["max"] <= 15
    assert found["closed"]["gains"]["integral"] == pytest.approx(integral_for(np.pi / 3, 1))
    assert found["paper"]["gains"] == {"proportional": 0.01, "integral": 0.002}
    assert [found[name]["runs"] for name in ("open", "closed")] == [1, 2]
    assert len(results["headline"]) == 3


def test_commands_of_bounded_pressure_go_as_far_as_the_model_knows(tmp_path, model_folder):
    """A stiffer robot needs more than takes the model to its course; the bound of what it is told is what counts."""
    spec = load(tmp_path, "loop.seeds=[1]")
    short = 5 / load_model(model_folder).reach[0, 1]
    bound = control(tmp_path, spec, model_folder, short)["loop"]["points"]["closed"]
    free = control(tmp_path, spec, model_folder, short, np.array([[0.0, 10.0]] * 2))["loop"]["points"]["closed"]
    assert bound["reached"]["max"] == 0 and free["reached"]["max"] == 2


def test_fe_matrices_are_a_controller_s_model(tmp_path):
    robot = bar()
    real = FemPlant(robot)
    aims = np.array([share * robot.reach[:, 1] for share in (0.2, 0.25, 0.3)])
    goals = {"points": np.array([robot.rest_e + real.at_displacement(aim).delta_e for aim in aims])}
    fe = "loop.controllers={fe: {mode: open, model: fe-based, iterations: 20}}"
    spec = load(tmp_path, fe, "loop.real.stiffer=1", "loop.sensor={}")
    found = run_controllers(tmp_path, spec, tmp_path, robot, {"spectral": real}, goals, search(robot, real))
    assert found["loop"]["points"]["fe"]["error_at_goals"]["max"] < 1e-3


def test_the_table_holds_every_tick(tmp_path, model_folder):
    results = control(tmp_path, load(tmp_path), model_folder)
    table = pq.read_table(tmp_path / "loop.parquet", page_checksum_verification=True).to_pylist()
    closed = [row for row in table if row["controller"] == "closed" and row["seed"] == 2]
    assert [row["tick"] for row in closed] == list(range(1, len(closed) + 1))
    assert closed[4]["measured_tick"] == 4 and closed[4]["seconds"] == pytest.approx(0.1)
    at = [np.linalg.norm(np.array(row["x_e"]) - row["goal"]) for row in closed]
    np.testing.assert_allclose([row["error"] for row in closed], at, atol=1e-12)
    assert len({row["seed"] for row in table if row["controller"] == "open"}) == 1
    assert results["loop"]["points"]["closed"]["ticks"] * 2 == sum(row["controller"] == "closed" for row in table)


def test_the_same_spec_is_the_same_table(tmp_path, model_folder):
    tables = []
    for _ in range(2):
        control(tmp_path, load(tmp_path), model_folder)
        tables.append(repr(pq.read_table(tmp_path / "loop.parquet").drop_columns(["step_us"]).to_pylist()))
    assert tables[0] == tables[1]


def test_goals_by_the_clock(tmp_path, model_folder):
    spec = load(tmp_path, "loop.goal_every=0.1 s", "loop.approach=0.4 s", "loop.seeds=[1]")
    found = control(tmp_path, spec, model_folder)["loop"]["points"]["closed"]
    assert found["ticks"] == 20 + 5 and found["ticks_to_converge"] is None
    assert found["error_at_goals"]["max"] < found["error"]["max"]


def test_a_budget_ends_the_run(tmp_path, model_folder):
    found = control(tmp_path, load(tmp_path, "loop.budget=0.5 s"), model_folder)["loop"]["points"]
    assert found["closed"]["ticks"] == 25 and found["closed"]["reached"]["max"] == 1


@pytest.mark.parametrize("overrides", [[], ["loop.laps={speeds: [1 Hz], laps: 1, run_up: 0 s}"]])
def test_a_goal_that_is_too_far_away_is_named_before_the_first_tick(tmp_path, model_folder, monkeypatch, overrides):
    """Also one that is the robot's own image, or lies between others on a lap."""
    steps = []
    monkeypatch.setattr(ModelPlant, "step", lambda *_: steps.append(1))
    words = r"trajectories.points.*: goal \d+ is \d+ mm from where the effector rests, .*`length` of the scene"
    with pytest.raises(SpecError, match=words):
        control(tmp_path, load(tmp_path, *overrides), model_folder, lengths=2.5)
    assert not steps


def device(words):
    return json.dumps({"kind": "program", "command": words})


def test_a_device_is_a_plant(tmp_path, model_folder):
    words = [sys.executable, "-m", "cfem.plant.device.fake", str(model_folder), "--stiffer", "1.1", "--delay", "1"]
    fast = ["loop.rate=1 kHz", "loop.settle.hold=10 ms", "loop.settle.at_most=40 ms"]
    closed = "loop.controllers={closed: {mode: closed}}"
    patient = "loop.answer_within=20 s"  # a busy machine takes a second to end a program
    overrides = ["plant=device", "loop.real.stiffer=1", "loop.seeds=[0]", closed, patient, *fast]
    found = control(tmp_path, load(tmp_path, *overrides, f"loop.device={device(words)}"), model_folder)
    assert found["loop"]["points"]["closed"]["reached"]["min"] == 2
    assert not list(tmp_path.glob("*.jsonl"))
    dying = device([*words, "--fail", "die", "--at", "5"])
    for run in (1, 2):
        with pytest.raises(InputError, match=rf"ended.*; the 4 ticks before are kept in \S+interrupted-{run}\.jsonl"):
            control(tmp_path, load(tmp_path, *overrides, f"loop.device={dying}"), model_folder)
        kept = [json.loads(line) for line in (tmp_path / f"interrupted-{run}.jsonl").read_text().splitlines()]
        assert [row["tick"] for row in kept] == [1, 2, 3, 4]
        assert set(kept[0]) == set(pq.read_table(tmp_path / "loop.parquet").column_names)
        assert kept[-1]["x_e"] and len(kept[-1]["command"]) == 2


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="this system has no pseudo-terminals")
def test_a_board_on_a_serial_port_is_a_plant(tmp_path, model_folder):
    """The loop commands forces; so does the exported firmware."""
    meta, arrays = read_model(model_folder)
    program = firmware(tmp_path / "c", (meta, arrays), controller={"command": "force"})
    fast = ["loop.rate=50 Hz", "loop.settle.hold=60 ms", "loop.settle.at_most=400 ms", "loop.answer_within=20 s"]
    overrides = ["plant=device", "loop.real.stiffer=1", "loop.controllers={closed: {mode: closed}}", *fast]
    for seeds in ("[0]", "[0, 1]"):
        with on_a_serial_port(program) as channel:
            port = f"loop.device={{kind: serial, port: {channel.port}}}"
            found = control(tmp_path, load(tmp_path, *overrides, port, f"loop.seeds={seeds}"), model_folder)
        points = found["loop"]["points"]["closed"]
        assert points["reached"]["min"] == 2 and len(points["losses"]) == len(json.loads(seeds))
        assert all(lost["skipped"] == 0 for lost in points["losses"])


@pytest.mark.parametrize(
    "pipeline",
    [
        *(f"soft-finger/control-{name}" for name in ("closed-loop", "device")),
        *(f"stiff-flop-experiments/control-{name}" for name in ("circle", "circle-bbrfem", "points", "points-bbrfem")),
        "stiff-flop-experiments/control-disturbance",
    ],
)
def test_pipelines_are_valid(pipeline):
    assert load_spec(Path(__file__).parents[3] / "pipelines" / f"{pipeline}.yaml", ControlSpec).loop


@pytest.mark.parametrize(
    "override, words",
    [
        ("loop.sensor.rate=80 Hz", "not be above"),
        ("loop.rate=50", "a frequency with its unit"),
        ("loop.settle.hold=1 mm", "not a unit of time"),
        ("loop.command.step=5 kg", "or MPa"),
        ("loop.command.kind=pressure", "displacement, force"),
        ("loop.controllers.closed.gains={integral: 0.1, phase_margin: 60 deg}", "either integral or phase_margin"),
        ("loop.controllers.closed.gains={phase_margin: 90 deg}", "between 0 and 90 deg"),
        ("loop.controllers.open.gains={integral: 0.1}", "mode: open takes none"),
        ("loop.controllers.open.observr=measured", "did you mean 'observer'"),
        ("loop.controllers.open.model=mlp", r"models \['mlp'\] are not among"),
        ("plant=device", "needs loop.device"),
        ("loop.device={kind: can, port: x}", "kind"),
        ("loop.device={kind: udp, host: robot, port: 0}", "port"),
        ("plant=fem", "stiffer needs plant: model"),
        ("loop.real.scene=[material.young=1 MPa]", "need plant: fem"),
    ],
)
def test_mistakes_are_named(tmp_path, override, words):
    with pytest.raises(SpecError, match=words):
        load(tmp_path, override)


def test_a_push_moves_the_fe_effector_by_its_compliance():
    robot, push = bar(), np.array([0.0, 0.0, 1e-4])
    free = FemPlant(robot)
    before, after = free.step(np.zeros(2), "force"), FemPlant(pushed(robot, push)).step(np.zeros(2), "force")
    W = free.at_displacement(before.delta_a).W
    np.testing.assert_allclose(
        after.x_e - before.x_e, W[:3, :3] @ push, rtol=1e-3, atol=1e-4 * np.abs(W[:3, :3] @ push).max()
    )


@pytest.mark.slow
def test_a_controller_adapts_to_a_robot_that_changes(tmp_path, tmp_path_factory):
    folder = train_folder(tmp_path_factory.mktemp("p"), "{kind: spectral, max_degree: 8}", train=80, parameters=True)
    adapt = "loop.controllers={plain: {mode: open}, adaptive: {mode: open, adapt: {noise: 0.02 mm, find: [young]}}}"
    drift = "loop.real={drift: {stiffness: 0.9, within: 2 s}}"
    more = ("loop.seeds=[1]", "loop.goal_every=3 s", "loop.approach=3 s")
    results = control(tmp_path, load(tmp_path, adapt, drift, *more), folder)["loop"]["points"]
    assert results["adaptive"]["parameters"]["young"] == pytest.approx(2.7, rel=0.02)
    assert results["adaptive"]["error_at_goals"]["max"] < 0.3 * results["plain"]["error_at_goals"]["max"]
    rows = pq.read_table(tmp_path / "loop.parquet").to_pylist()
    known = {row["controller"]: row["parameters"] for row in rows}
    assert np.isnan(known["plain"]).all() and np.isfinite(known["adaptive"]).all()


def test_a_model_without_parameters_adapts_nothing_which_is_said_before_the_first_tick(
    tmp_path, model_folder, monkeypatch
):
    monkeypatch.setattr(ModelPlant, "step", None)
    adapt = "loop.controllers={plain: {mode: open}, adaptive: {mode: open, adapt: {noise: 0.02 mm}}}"
    with pytest.raises(SpecError, match="has no parameters"):
        control(tmp_path, load(tmp_path, adapt), model_folder)


@pytest.mark.parametrize(
    ("controller", "said"),
    [
        ("{mode: policy}", "mode: policy needs policy"),
        ("{mode: open, policy: some.onnx}", "mode: policy needs policy"),
        ("{mode: policy, policy: some.onnx, gains: {integral: 0.1}}", "mode: policy takes none"),
        ("{mode: open, model: fe-based, adapt: {noise: 1 mm}}", "adapt needs a learned model"),
    ],
)
def test_controllers_that_contradict_themselves_are_refused(tmp_path, controller, said):
    with pytest.raises(SpecError, match=said):
        load(tmp_path, f"loop.controllers={{one: {controller}}}")


def test_a_design_is_not_adapted_and_does_not_move(tmp_path):
    adapt = "loop.controllers={one: {mode: open, adapt: {noise: 1 mm}}}"
    with pytest.raises(SpecError, match="states what adapt would find"):
        load(tmp_path, adapt, "design={young: 3 MPa}")
    with pytest.raises(SpecError, match="not go with a loop that moves"):
        load(tmp_path, "loop.moving={}", "design={young: 3 MPa}")


def test_a_policy_that_is_not_there_gets_one_sentence(tmp_path, model_folder):
    one = "loop.controllers={one: {mode: policy, policy: none.onnx}}"
    with pytest.raises(InputError, match="no such file"):
        control(tmp_path, load(tmp_path, one, "loop.command={kind: displacement}"), model_folder)
