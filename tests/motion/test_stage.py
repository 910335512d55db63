"""`cfem simulate`: tables of commands to motion, beside full finite elements, and what it says of bad input."""

from types import SimpleNamespace

import numpy as np
import pytest

from cfem.core.errors import InputError, SpecError
from cfem.core.stage import Options
from cfem.dataset.parquet import read_parquet
from cfem.motion.commands import read_commands, starting
from cfem.motion.load import load_motion
from cfem.motion.payload import Payload
from cfem.motion.stage import FULL, TABLE, _headline, run
from cfem.motion.step import MotionCommand, step

QUIET = Options(quiet=True)
RAMP = "time [s],cable.displacement [mm]\n0,2\n0.02,2.5\n0.06,2.5\n"


@pytest.fixture
def spec(root, tmp_path):
    """Writes commands and a spec of the bar's model; more: lines of YAML."""

    def write(commands, more=""):
        (tmp_path / "commands.csv").write_text(commands)
        path = tmp_path / "simulate.yaml"
        model = root / "models" / "bar" / "spectral"
        path.write_text(f"model: {model}\ncommands: commands.csv\nout: out\n{more}")
        return path

    return write


def test_it_moves_as_full_finite_elements_do(root, spec):
    """At the resolution that the model was learned from, with a payload."""
    scene = root / "pipelines" / "bar" / "scene.yaml"
    gravity = "{m/s^2: [0, 0, -9.81]}"
    path = spec(RAMP, f"step: 0.5 ms\nfull: {{scene: {scene}}}\npayload: {{mass: 0.5 g, gravity: {gravity}}}\n")
    results = run(path, [], None, QUIET)["results"]
    assert results["steps"] == 120 and results["commanded"] == "displacement"
    assert results["headline"][0].startswith("120 steps of 0.5 ms to 0.06 s; first natural frequency ")
    assert results["full"]["percent_of_travel"] < 3.0 and results["full"]["why"] is None
    table, full = (read_parquet(path.parent / "out" / name) for name in (TABLE, FULL))
    assert table.column_names == full.column_names and len(table) == 121
    assert {"time", "cable.displacement", "cable.force", "cable.slack", "tip.x"} <= set(table.column_names)
    np.testing.assert_allclose(table["cable.displacement"].to_numpy()[-1], 2.5, atol=1e-9)
    tips = [np.column_stack([each[f"tip.{axis}"].to_numpy() for axis in "xyz"]) for each in (table, full)]
    at = full["time"].to_numpy()
    learned = np.column_stack([np.interp(at, table["time"].to_numpy(), column) for column in tips[0].T])
    largest = np.linalg.norm(learned - tips[1], axis=1).max()
    beside, travel = results["full"], [np.linalg.norm(np.ptp(each, axis=0)) for each in tips]
    assert beside["largest_mm"] == pytest.approx(largest) and beside["steps"] == len(full) - 1
    assert beside["percent_of_travel"] == pytest.approx(100 * largest / travel[1])
    assert results["travel_mm"] == [pytest.approx(travel[0])] and beside["refused"] == 0
    assert at[-1] == pytest.approx(0.06) and np.diff(at).max() <= 2 * 0.5e-3 * (1 + 1e-9)


def test_forces_begin_at_rest_and_stay_there(root, spec):
    model = load_motion(root / "models" / "bar" / "spectral")
    path = spec("time [s],cable.force [N]\n0,0.6\n1,0.6\n")
    commands = read_commands(path.parent / "commands.csv", model)
    for payload in (None, Payload(5e-7, gravity=(0.0, 0.0, -9810.0))):
        start = starting(model, commands, payload)
        np.testing.assert_allclose(start.lam, 0.6, rtol=1e-8)
        later = step(model, start, MotionCommand(force=start.lam), 1e-2, payload)
        np.testing.assert_allclose(later.q, start.q, atol=1e-7)
    assert max(run(path, ["until=0.05 s"], None, QUIET)["results"]["travel_mm"]) < 1e-6


def test_it_says_where_the_model_knows_nothing(spec):
    results = run(spec("time [s],cable.displacement [mm]\n0,7\n0.2,12\n"), ["step=2 ms"], None, QUIET)["results"]
    assert results["left_s"] < 0.2 and "its error is unknown" in results["headline"][0]


@pytest.mark.parametrize(
    ("commands", "message"),
    [
        ("time [s],cabel.displacement [mm]\n0,2\n", "expected one of time, cable.displacement"),
        ("time [s],cable.displacement [N]\n0,2\n", "length"),
        ("time [s]\n0\n", "no commands"),
        ("cable.displacement [mm]\n2\n", "no column 'time'"),
        ("time [s],cable.displacement [mm],cable.force [N]\n0,2,1\n", "both displacements and forces"),
        ("time [s],cable.displacement [mm]\n0,2\n0.1,\n", "csv:3: a gap"),
        ("time [s],cable.displacement [mm]\n0,2\n0,3\n", "csv:3: its time"),
        ("time [s],cable.displacement [mm]\n", "no rows"),
    ],
)
def test_a_bad_table_says_what_is_wrong(spec, commands, message):
    with pytest.raises(InputError, match=message):
        run(spec(commands), [], None, QUIET)


def test_a_bad_spec_says_what_is_wrong(spec):
    with pytest.raises(SpecError, match="begin"):
        run(spec("time [s],cable.displacement [mm]\n1,2\n2,3\n"), ["until=0.5 s"], None, QUIET)
    with pytest.raises(SpecError, match="no effector"):
        run(spec(RAMP, "payload: {mass: 1 g, effector: hand}\n"), [], None, QUIET)


@pytest.mark.parametrize(("unit", "poor"), [("m/s^2", 0), ("mm/s^2", 1)])
def test_a_payload_whose_weight_is_in_another_unit_is_poor(spec, unit, poor):
    payload = f"payload: {{mass: 0.5 g, gravity: {{{unit}: [0, 0, -9.81]}}}}\n"
    found = run(spec(RAMP, payload), [], None, QUIET)["results"].get("judgement", [])
    assert len(found) == poor and all("payload.gravity is 0.00981 m/s^2" in each["what"] for each in found)


@pytest.mark.parametrize("full", [None, "", "a cell turned over"])
@pytest.mark.parametrize("hard", [False, True])
def test_people_are_told_what_a_motion_met(full, hard):
    """Where it leaves what is known and where it ends early come first."""
    results = {"step_s": 2e-3, "steps": 50, "first_frequency_Hz": 33.27, "travel_mm": [1.25, 4.5]}
    results["slack_steps"] = [0, 3] if hard else [0, 0]
    if full is not None:
        results["full"] = {"largest_mm": 0.125, "percent_of_travel": 2.5, "why": full}
    halved = [(0.03, 1e-3, "no state"), (0.05, 5e-4, "other")] if hard else []
    run = SimpleNamespace(left=0.04 if hard else None, shortened=halved)
    lines = _headline(results, run, ["up", "down"], 0.1)
    expected = ["from 0.04 s on the motion leaves the training states: its error is unknown"] * hard
    expected += ["50 steps of 2 ms to 0.1 s; first natural frequency 33.3 Hz"]
    expected += [f"the effectors travel 4.5 mm; {TABLE}"]
    if hard:
        expected.append("2 steps were halved; the first, of 0.001 s at 0.03 s: no state")
        expected.append("cables that were slack for a while: down")
    if full is not None:
        expected.append("full finite elements: the effectors differ by 0.125 mm at most, 2.5 % of their travel")
    assert lines == ([f"full finite elements ended early: {full}"] if full else []) + expected
    if hard:
        run.shortened = halved[:1]
        assert "1 step was halved; the first, of 0.001 s at 0.03 s: no state" in _headline(
            results, run, ["a", "b"], 0.1
        )
