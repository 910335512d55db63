"""Devices as plants: the pipe protocol with the fake device, and with devices that fail."""

import json
import os
import re
import signal
import sys
import textwrap
import time
from contextlib import nullcontext, suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from surrogate.stored import train_folder

from cfem import make_controller
from cfem.condensed import Rows
from cfem.core.errors import InputError
from cfem.plant.device.device_plant import DevicePlant
from cfem.plant.device.lines import Lines
from cfem.plant.imperfect_plant import Imperfection, ImperfectPlant, Stiffer
from cfem.plant.model_plant import ModelPlant
from cfem.predict.load import load_model

ROWS = Rows(("x", "y"), ("a",))


@pytest.fixture
def impatient(monkeypatch):
    """A device that does not end by itself is not waited for."""
    monkeypatch.setattr("cfem.plant.device.process.LET_GO", 0.2)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return train_folder(tmp_path_factory.mktemp("pipe"), "{kind: spectral, max_degree: 8}", train=40)


def fake(folder, *options, **changes):
    model = load_model(folder)
    command = [sys.executable, "-m", "cfem.plant.device.fake", str(folder), *options]
    return DevicePlant(Lines(command), model.rows, model.rest_e, **{"timeout": 20.0} | changes)


def script(tmp_path, text, folder=None, **changes):
    """A device that runs `text` for every message `m` after hello."""
    path = tmp_path / "device.py"
    path.write_text(
        "import json, sys, time\n"
        "say = lambda x: print(json.dumps(x), flush=True)\n"
        "sys.stdin.readline()\n"
        'say({"ready": True, "version": 1})\n'
        "for line in sys.stdin:\n"
        "    m = json.loads(line)\n"
        "    if 'bye' in m:\n"
        "        break\n" + textwrap.indent(textwrap.dedent(text), "    ")
    )
    device = Lines([sys.executable, str(path)], folder)
    return DevicePlant(device, ROWS, **{"rest_e": np.zeros(2), "timeout": 20.0} | changes)


def test_the_fake_device_is_the_model_behind_a_pipe(folder):
    model = load_model(folder)
    same = ImperfectPlant(ModelPlant(Stiffer(model, 1.2), model.rest_e), Imperfection(noise=0.1, delay=1), 4)
    commands = [(np.array([4.0, 3.5]), "displacement"), (np.array([9.0, 8.0]), "force"), (np.zeros(2), "force")]
    with fake(folder, "--stiffer", "1.2", "--noise", "0.1", "--delay", "1", "--seed", "4") as plant:
        for u, kind in commands:
            got, expected = plant.step(u, kind), same.step(u, kind)
            assert got.t == expected.t
            np.testing.assert_allclose(got.x_e, expected.x_e, atol=1e-9)
    assert plant.transport.returncode == 0


def test_without_options_the_fake_device_is_the_model_itself(folder):
    model = load_model(folder)
    with fake(folder) as plant:
        seen = plant.step(np.array([4.0, 3.5]))
    state = model.at_displacement(np.array([4.0, 3.5]))
    assert seen.t == 1
    np.testing.assert_allclose(seen.x_e, model.rest_e + state.delta_e, atol=1e-12)
    np.testing.assert_allclose(seen.delta_a, [4.0, 3.5], atol=1e-12)


@pytest.mark.slow
def test_a_late_and_slow_device_is_led_to_its_goal(folder):
    model = load_model(folder)
    controller, goal = make_controller(model, command="force"), model.rest_e + model.at_displacement([6.0, 5.0]).delta_e
    measured, errors = None, []
    with fake(folder, "--stiffer", "1.1", "--delay", "5", "--every", "3", timeout=20.0) as plant:
        for _ in range(80):
            measured = plant.step(controller.tick(goal, measured).u, "force")
            errors.append(np.linalg.norm(measured.x_e - goal))
    assert controller.feedback.late == 1 and errors[8] > 1.0 > 100 * max(errors[60:])


def test_hello_says_who_asks_and_for_which_robot(tmp_path):
    path = tmp_path / "device.py"
    path.write_text("import sys; open('hello.json', 'w').write(sys.stdin.readline()); print('{}', flush=True)")
    with (
        pytest.raises(InputError, match="to hello"),
        DevicePlant(Lines([sys.executable, str(path)], tmp_path), ROWS, np.array([1.0, 2.0])),
    ):
        pass
    assert json.loads((tmp_path / "hello.json").read_text()) == {
        "hello": "cfem-plant",
        "version": 1,
        "effectors": list(ROWS.effectors),
        "actuators": list(ROWS.actuators),
        "rest_e": [1.0, 2.0],
    }


@pytest.mark.parametrize(
    "how, words", [("die", r"ended \(exit code 3\)"), ("hang", "no answer within 1.5 s"), ("garbage", "no JSON object")]
)
def test_a_device_that_fails_is_one_error(request, folder, how, words):
    if how == "hang":
        request.getfixturevalue("impatient")
    with fake(folder, "--fail", how, "--at", "2", timeout=1.5 if how == "hang" else 60.0) as plant:
        plant.step(np.ones(2))
        with pytest.raises(InputError, match=words) as caught:
            plant.step(np.ones(2))
    assert "plant.device.fake" in str(caught.value) and "docs/closed-loop.md" in str(caught.value)
    assert plant.transport.returncode is not None


@pytest.mark.parametrize(
    "answer, words",
    [
        ("{'t': 1, 'x_e': [1.0]}", "expected 2 finite numbers or null"),
        ("{'t': 1, 'x_e': [1.0, float('nan')]}", "expected 2 finite numbers"),
        ("{'t': 1, 'x_e': 'here'}", "expected 2 finite numbers"),
        ("{'t': 2, 'x_e': [1.0, 2.0]}", "answered t = 2 to step 1"),
        ("{'x_e': [1.0, 2.0]}", "answered t = null"),
        ("[1, 2]", "no JSON object"),
        ("{'error': 'valve 3 leaks'}", "reports: valve 3 leaks"),
        ("{'error': '\\ud800\\x1b[2J' * 99}", r"reports: \\ud800\\x1b"),
        ("{'t': 1, 'x_e': [True, False]}", "expected 2 finite numbers"),
        ("{'t': 1, 'x_e': ['1', '2']}", "expected 2 finite numbers"),
        ("{'t': 1, 'x_e': [[1.0], [2.0]]}", "expected 2 finite numbers"),
        ("{'t': 1, 'x_e': [10**400, 0]}", "expected 2 finite numbers"),
        ("{'t': 10**400, 'x_e': [0, 0]}", "answered t = 1000"),
        ("{'t': True, 'x_e': [0, 0]}", "answered t = true"),
        ("{'t': 1.0, 'x_e': [0, 0]}", "answered t = 1.0"),
        ("{'t': 1, 'x_e': [0, 0], 'delta_a': [False]}", "expected 1 finite numbers"),
        ("{'t': 1, 'x_e': [0, 2e3]}", "number 2 is 2e[+]03 from rest, at most 1e[+]03.*units"),
        ("{'t': 1, 'x_e': [0, 0], 'delta_a': [301]}", "at most 300"),
    ],
)
def test_malformed_answers_are_named(tmp_path, answer, words):
    robot = {"length": 100.0, "reach": np.array([[0.0, 30.0]])}
    with script(tmp_path, f"say({answer})", **robot) as plant, pytest.raises(InputError, match=words) as caught:
        plant.step(np.ones(1))
    assert len(str(caught.value)) < 500 and str(caught.value).isprintable()


def test_a_device_that_measures_in_metres_is_named(tmp_path):
    robot = {"length": 100.0, "rest_e": np.array([10.0, 100.0])}
    words = r"answered x_e = \[0.012, 0.095\], which is in metres: x_e is in mm"
    answer = "say({'t': 1, 'x_e': [0.012, 0.095]})"
    with script(tmp_path, answer, **robot) as plant, pytest.raises(InputError, match=words):
        plant.step(np.ones(1))


@pytest.mark.parametrize(
    "said, words",
    [
        ("b'[' * 100_000", "nested deeper than 8"),
        ("b'{\"t\": ' + b'9' * 10_000 + b'}'", "no JSON object"),
        ("b' ' * 300_000", "a line of more than 262144 bytes"),
        ("b'x' * 50_000_000", "a line of more than 262144 bytes"),
        ("b'\\xff\\x00\\x1b]0;'", "no JSON object"),
        ("b'' if sys.stdout.close() else b''", "ended|closed its output"),
    ],
)
def test_lines_that_are_none_are_named(tmp_path, said, words):
    text = f"said = {said}\nsys.stdout.buffer.write(said + b'\\n')\nsys.stdout.flush()"
    with script(tmp_path, text, timeout=20.0) as plant, pytest.raises(InputError, match=words) as caught:
        plant.step(np.ones(1))
    assert len(str(caught.value)) < 500 and str(caught.value).isprintable()


@pytest.mark.parametrize(
    "second, words",
    [
        ("{'t': 1, 'x_e': [0, 1]}", "another sample for t = 1"),
        ("{'t': 0, 'x_e': [0, 0]}", "answered t = 0 after t = 1"),
        ("{'t': 1, 'x_e': [0, 0]}", None),
        ("{'t': 1, 'x_e': None}", None),
    ],
)
def test_a_step_is_measured_once(tmp_path, second, words):
    text = f"say({second} if m['t'] == 2 else {{'t': 1, 'x_e': [0, 0]}})"
    with script(tmp_path, text) as plant:
        plant.step(np.ones(1))
        with pytest.raises(InputError, match=words) if words else nullcontext():
            plant.step(np.ones(1))


def test_one_that_closes_its_output_and_lives_on_is_told_goodbye(tmp_path):
    text = """
        import os
        os.close(1)
        for line in sys.stdin:
            if 'bye' in line:
                open('released', 'w').write(line)
                break
    """
    with (
        script(tmp_path, text, folder=tmp_path, timeout=20.0) as plant,
        pytest.raises(InputError, match="closed its output and lives on"),
    ):
        plant.step(np.ones(1))
    assert (tmp_path / "released").read_text() == '{"bye": true}\n' and plant.transport.returncode == 0


def ended(process):
    try:
        return "State:\tZ" in Path(f"/proc/{process}/status").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return True


@pytest.mark.usefixtures("impatient")
@pytest.mark.skipif(not hasattr(os, "killpg"), reason="this system has no process groups")
def test_one_that_listens_to_nothing_is_ended_with_its_children(tmp_path):
    text = """
        import os, signal, subprocess
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        child = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(600)'])
        say({'t': child.pid, 'x_e': [0, 0]})
        time.sleep(600)
    """
    with script(tmp_path, text, timeout=20.0) as plant, pytest.raises(InputError, match="answered t = ") as caught:
        plant.step(np.ones(1))
    child = int(re.search(r"answered t = (\d+)", str(caught.value))[1])
    assert plant.transport.returncode == -signal.SIGKILL
    # The signal was sent; the system ends a process when it next gives it time.
    assert any(ended(child) or time.sleep(0.05) for _ in range(200))


@pytest.mark.usefixtures("impatient")
def test_one_that_does_not_read_holds_nobody_up(tmp_path):
    """A command longer than a pipe holds, to a device that never reads it."""
    text = "time.sleep(600)"
    plant = script(tmp_path, text, timeout=0.5)
    plant._rows = Rows(("x", "y"), tuple(f"a{k}" for k in range(20_000)))
    with plant:
        with pytest.raises(InputError, match=r"no answer within 0\.5 s"):
            plant.step(np.full(20_000, np.pi))
        with pytest.raises(InputError, match=r"no answer within 0\.5 s"):
            plant.step(np.full(20_000, np.pi))
    assert plant.transport.returncode is not None


def judged_over_the_pipe(said, then):
    """A device that says these bytes at the first command, then goes on, ends or closes its output."""
    code = (
        "import os, sys\n"
        "sys.stdin.readline()\n"
        'os.write(1, b\'{"ready": true, "version": 1}\\n\')\n'
        "sys.stdin.readline()\n"
        f"os.write(1, bytes.fromhex('{said.hex()}'))\n"
        f"{then}\n"
        "while sys.stdin.readline(): pass\n"
    )
    robot = {"length": 100.0, "reach": np.array([[0.0, 30.0]])}
    with DevicePlant(Lines([sys.executable, "-S", "-E", "-c", code]), ROWS, np.zeros(2), timeout=0.4, **robot) as plant:
        for _ in range(2):
            with suppress(InputError):
                found = plant.step(np.ones(1))
                assert found.t in (0, 1) and (np.isnan(found.x_e).all() or np.abs(found.x_e).max() <= 1000)
    assert plant.transport.returncode is not None


SAID = st.one_of(
    st.binary(max_size=60),
    st.lists(st.sampled_from([b'{"t": 1, "x_e": [0, 0]}', b"\n", b"[", b"}", b'{"t": 1}', b"9" * 400])).map(b"".join),
)
THEN = st.sampled_from(["pass", "os.close(1)", "sys.exit(4)"])


@settings(max_examples=6, deadline=None)
@given(said=SAID, then=THEN)
def test_any_bytes_over_the_pipe_end_in_a_sentence(said, then):
    judged_over_the_pipe(said, then)


@pytest.mark.slow
@settings(max_examples=100, deadline=None)
@given(said=SAID, then=THEN)
def test_any_of_many_bytes_over_the_pipe_end_in_a_sentence(said, then):
    judged_over_the_pipe(said, then)


@pytest.mark.parametrize("cause", [KeyboardInterrupt, SystemExit, RuntimeError, GeneratorExit])
def test_whatever_ends_the_run_the_device_is_told_goodbye(tmp_path, cause):
    text = "say({'t': m['t'], 'x_e': [0, 0]})"
    device = script(tmp_path, text, folder=tmp_path)
    path = tmp_path / "device.py"
    path.write_text(path.read_text().replace("break", "open('released', 'w').write(line); break"))
    with pytest.raises(cause), device as plant:
        plant.step(np.ones(1))
        raise cause
    assert (tmp_path / "released").exists() and plant.transport.returncode == 0


def test_a_device_that_talks_too_much_is_stopped(tmp_path):
    with script(tmp_path, "say({'t': m['t'], 'x_e': [0, 0]})\nsay({})\n", period=0.1) as plant:
        plant.step(np.ones(1))
        with pytest.raises(InputError, match="without being asked"):
            plant.step(np.ones(1))


def test_an_effector_out_of_sight_is_a_measurement(tmp_path):
    with script(tmp_path, "say({'t': m['t'], 'x_e': None, 'lambda_a': [2.0]})") as plant:
        seen = plant.step(np.ones(1))
    assert np.isnan(seen.x_e).all() and seen.delta_a is None and seen.lambda_a == 2.0
    assert seen.status != "converged"


def test_a_device_of_another_protocol_is_refused():
    command = [sys.executable, "-c", "input(); print('{}', flush=True); input()"]
    with pytest.raises(InputError, match="to hello"), DevicePlant(Lines(command), ROWS, np.zeros(2)):
        pass


def test_a_device_of_another_robot_is_refused(folder):
    plant = fake(folder)
    plant._rows = ROWS
    with pytest.raises(InputError, match="the model has rows"), plant:
        pass


def test_a_program_that_is_not_there():
    with (
        pytest.raises(InputError, match="cannot be started"),
        DevicePlant(Lines(["./no-such-device"]), ROWS, np.zeros(2)),
    ):
        pass


def test_it_starts_in_its_folder(tmp_path):
    script(tmp_path, "say({'t': m['t'], 'x_e': [0, 0]})")
    with DevicePlant(Lines([sys.executable, "device.py"], tmp_path), ROWS, np.zeros(2)) as plant:
        assert plant.step(np.ones(1)).t == 1


class Clock:
    """Stands still but for what is slept, and for what an answer takes."""

    def __init__(self):
        self.now, self.slept = 100.0, []

    def monotonic(self):
        return self.now

    def sleep(self, seconds):
        self.slept.append(seconds)
        self.now += seconds


@pytest.mark.parametrize("takes, slept, late", [(0.02, [0.03] * 3, 0), (0.07, [], 3)])
def test_the_period_is_kept_and_lateness_counted(tmp_path, monkeypatch, takes, slept, late):
    clock = Clock()
    monkeypatch.setattr("cfem.plant.device.device_plant.time", clock)
    with script(tmp_path, "say({'t': m['t'], 'x_e': [0, 0]})", period=0.05) as plant:
        ask = plant._ask

        def slowly(*message):
            clock.now += takes
            return ask(*message)

        plant._ask = slowly
        for _ in range(4):
            plant.step(np.ones(1))
        plant._ask = ask
    assert clock.slept == pytest.approx(slept) and plant.late == late


def test_a_device_may_see_markers_instead_of_the_effectors(tmp_path):
    """Of those that are named in hello; null or left out where it sees none."""
    text = """
        say({"t": m["t"], "markers": {"top": [1, 2, 3], "side": None}, "delta_a": [0.5]})
    """
    with script(tmp_path, text, markers=("top", "side", "end")) as plant:
        found = plant.step(np.zeros(1))
    assert found.status == "converged" and np.isnan(found.x_e).all() and found.delta_a == [0.5]
    np.testing.assert_array_equal(found.markers, [[1, 2, 3], [np.nan] * 3, [np.nan] * 3])


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        ('"markers": {"tip": [1, 2, 3]}', "expected an object of some of top, side"),
        ('"markers": {"top": [1, 2]}', "expected 3 finite numbers or null"),
        ('"x_e": [0, 0]', "expected an object of some of top, side"),
    ],
)
def test_markers_that_are_none_get_one_sentence(tmp_path, answer, said):
    device = script(tmp_path, f'say({{"t": m["t"], {answer}}})', markers=("top", "side"))
    with device as plant, pytest.raises(InputError, match=said):
        plant.step(np.zeros(1))
