"""The pipe protocol with the fake device, and with devices that fail."""

import json
import sys
import textwrap

import numpy as np
import pytest
from surrogate.stored import train_folder

from cfem.condensed import Rows
from cfem.core.errors import InputError
from cfem.plant.imperfect_plant import Imperfection, ImperfectPlant, Stiffer
from cfem.plant.model_plant import ModelPlant
from cfem.plant.pipe_plant import PipePlant
from cfem.predict.load import load_model

ROWS = Rows(("x", "y"), ("a",))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return train_folder(tmp_path_factory.mktemp("pipe"), "{kind: spectral, max_degree: 8}", train=40)


def fake(folder, *options, **changes):
    model = load_model(folder)
    command = [sys.executable, "-m", "cfem.plant.fake_device", str(folder), *options]
    return PipePlant(command, model.rows, model.rest_e, **changes)


def script(tmp_path, text, **changes):
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
    return PipePlant([sys.executable, str(path)], ROWS, np.zeros(2), **changes)


def test_the_fake_device_is_the_model_behind_a_pipe(folder):
    model = load_model(folder)
    same = ImperfectPlant(ModelPlant(Stiffer(model, 1.2), model.rest_e), Imperfection(noise=0.1, delay=1), 4)
    commands = [(np.array([4.0, 3.5]), "displacement"), (np.array([9.0, 8.0]), "force"), (np.zeros(2), "force")]
    with fake(folder, "--stiffer", "1.2", "--noise", "0.1", "--delay", "1", "--seed", "4") as plant:
        for u, kind in commands:
            got, expected = plant.step(u, kind), same.step(u, kind)
            assert got.t == expected.t
            np.testing.assert_allclose(got.x_e, expected.x_e, atol=1e-9)
    assert plant._process.returncode == 0


def test_without_options_the_fake_device_is_the_model_itself(folder):
    model = load_model(folder)
    with fake(folder) as plant:
        seen = plant.step(np.array([4.0, 3.5]))
    state = model.at_displacement(np.array([4.0, 3.5]))
    assert seen.t == 1
    np.testing.assert_allclose(seen.x_e, model.rest_e + state.delta_e, atol=1e-12)
    np.testing.assert_allclose(seen.delta_a, [4.0, 3.5], atol=1e-12)


def test_hello_says_who_asks_and_for_which_robot(tmp_path):
    path = tmp_path / "device.py"
    path.write_text("import sys; open('hello.json', 'w').write(sys.stdin.readline()); print('{}', flush=True)")
    with (
        pytest.raises(InputError, match="to hello"),
        PipePlant([sys.executable, str(path)], ROWS, np.array([1.0, 2.0]), folder=tmp_path),
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
def test_a_device_that_fails_is_one_error(folder, how, words):
    with fake(folder, "--fail", how, "--at", "2", timeout=1.5) as plant:
        plant.step(np.ones(2))
        with pytest.raises(InputError, match=words) as caught:
            plant.step(np.ones(2))
    assert "fake_device" in str(caught.value) and "docs/closed-loop.md" in str(caught.value)
    assert plant._process.returncode is not None


@pytest.mark.parametrize(
    "answer, words",
    [
        ("{'t': 1, 'x_e': [1.0]}", "expected 2 finite numbers or null"),
        ("{'t': 1, 'x_e': [1.0, float('nan')]}", "expected 2 finite numbers"),
        ("{'t': 1, 'x_e': 'here'}", "expected 2 finite numbers"),
        ("{'t': 2, 'x_e': [1.0, 2.0]}", "answered t = 2 to step 1"),
        ("{'x_e': [1.0, 2.0]}", "answered t = None"),
        ("[1, 2]", "no JSON object"),
        ("{'error': 'valve 3 leaks'}", "reports: valve 3 leaks"),
    ],
)
def test_malformed_answers_are_named(tmp_path, answer, words):
    with script(tmp_path, f"say({answer})") as plant, pytest.raises(InputError, match=words):
        plant.step(np.ones(1))


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
    command = [sys.executable, "-c", "print('{}'); input()"]
    with pytest.raises(InputError, match="to hello"), PipePlant(command, ROWS, np.zeros(2)):
        pass


def test_a_device_of_another_robot_is_refused(folder):
    plant = fake(folder)
    plant._rows = ROWS
    with pytest.raises(InputError, match="the model has rows"), plant:
        pass


def test_a_program_that_is_not_there():
    with pytest.raises(InputError, match="cannot be started"), PipePlant(["./no-such-device"], ROWS, np.zeros(2)):
        pass


def test_it_starts_in_its_folder(tmp_path):
    script(tmp_path, "say({'t': m['t'], 'x_e': [0, 0]})")
    with PipePlant([sys.executable, "device.py"], ROWS, np.zeros(2), folder=tmp_path) as plant:
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
    monkeypatch.setattr("cfem.plant.pipe_plant.time", clock)
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
