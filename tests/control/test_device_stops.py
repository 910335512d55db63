"""`cfem control` with a device: whatever ends it, the device is told goodbye."""

import json
import os
import signal
import subprocess
import sys
import textwrap

import pytest
from typer.testing import CliRunner

import cfem
from cfem.cli.app import app

SPEC = """
scene: {scene}
mesh: {mesh}
models: {{spectral: {model}}}
out: out
mesh_error: null
plant: device
trajectories:
  points: {{kind: goals, points: {{mm: [{goal}]}}}}
search: {{weights: [0, 0, 1]}}
loop:
  rate: 20 Hz
  command: {{kind: displacement}}
  controllers: {{closed: {{mode: closed}}}}
  settle: {{radius: 0.01 mm, hold: 600 s, at_most: 600 s}}
  device: {{kind: program, command: {device}}}
  answer_within: 20 s
"""
DEVICE = """
    import json, os, sys
    for line in sys.stdin:
        m = json.loads(line)
        if "bye" in m:
            open("released", "w").write(line)
            break
        if "hello" in m:
            answer = {"ready": True, "version": 1}
        else:
            open("tick", "w").write(str(m["t"]))
            answer = {"t": m["t"], "x_e": None}
            %s
        print(json.dumps(answer), flush=True)
"""


@pytest.fixture
def written(bar, tmp_path, monkeypatch):
    """Writes a spec with a device that does `more` at each command; the words that run it."""
    monkeypatch.chdir(tmp_path)

    def write(more="pass"):
        specs, model = bar / "pipelines" / "bar", bar / "models" / "bar" / "spectral"
        (tmp_path / "device.py").write_text(textwrap.dedent(DEVICE) % more)
        known = cfem.load_model(model)
        goal = (known.rest_e + known.at_displacement([5.0]).delta_e).tolist()
        places = {"scene": specs / "scene.yaml", "mesh": bar / "data" / "bar" / "mesh", "model": model, "goal": goal}
        text = SPEC.format(**places, device=json.dumps([sys.executable, "device.py"]))
        (tmp_path / "control.yaml").write_text(text)
        return ["control", "control.yaml", "--quiet"]

    return write


@pytest.fixture
def process(written):
    """A run in a session of its own, as in a terminal of its own."""
    words = [sys.executable, "-m", "cfem", *written()]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    running = subprocess.Popen(words, start_new_session=True, **pipes)
    yield running
    running.kill()
    running.communicate()


def wait_for(path, process):
    while not path.exists():
        assert process.poll() is None, process.communicate()
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(0.05)


@pytest.mark.skipif(not hasattr(os, "killpg"), reason="this system has no process groups")
@pytest.mark.parametrize(
    "number", [signal.SIGINT, *(pytest.param(one, marks=pytest.mark.slow) for one in (signal.SIGTERM, signal.SIGHUP))]
)
def test_a_signal_to_all_of_the_terminal_releases_the_robot(process, tmp_path, number):
    wait_for(tmp_path / "tick", process)
    os.killpg(process.pid, number)
    _, said = process.communicate(timeout=60)
    assert (tmp_path / "released").read_text() == '{"bye": true}\n'
    assert process.returncode == 130 and "cfem: interrupted" in said and "Traceback" not in said


def test_a_device_that_closes_its_output_and_lives_on_ends_the_run(written, tmp_path):
    done = CliRunner().invoke(app, written("if m['t'] == 3: os.close(1); continue"))
    assert (tmp_path / "released").exists() and done.exit_code == 3
    assert "closed its output and lives on" in done.stderr and "a defect" not in done.stderr


@pytest.mark.parametrize("answer", ["'[' * 100000", "'{\"t\": 1' + '0' * 400 + '}'"])
def test_what_is_no_answer_is_no_defect_of_cfem(written, tmp_path, answer):
    done = CliRunner().invoke(app, written(f"print({answer}, flush=True); continue"))
    assert (tmp_path / "released").exists() and done.exit_code == 3
    said = done.stderr
    assert "see the protocol" in said and "a defect" not in said and len(said.splitlines()) == 1
