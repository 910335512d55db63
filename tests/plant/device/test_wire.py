"""Devices at a wire: the firmware's example, compiled here, behind a pseudo-terminal and at UDP."""

import numpy as np
import pytest
from export.embedded import needs_compiler, spectral
from export.wired import BadWire, firmware, on_a_serial_port, on_an_emulated_board, on_udp
from support.waiting import wait_for

from cfem import make_controller
from cfem.condensed import Rows
from cfem.core.errors import InputError
from cfem.export.compiled.controller import CompiledController
from cfem.plant.device import device_plant
from cfem.plant.device.channel import SerialChannel, UdpChannel
from cfem.plant.device.device_plant import DevicePlant
from cfem.plant.device.frame import Frame, Kind, Receiver, robot_checksum
from cfem.plant.device.wire import TAKES, Wire
from cfem.plant.imperfect_plant import Stiffer
from cfem.plant.model_plant import ModelPlant
from cfem.predict.load import build

pytestmark = [needs_compiler, pytest.mark.skipif("not hasattr(__import__('os'), 'openpty')", reason="needs a pty")]
SINGLE = 1e-4  # mm: 110 mm in single precision, with room for the model's own rounding
TICK = 0.02  # s


@pytest.fixture(scope="module")
def model():
    return build(*spectral())


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    return firmware(tmp_path_factory.mktemp("wire"), own_clock=True)


@pytest.fixture
def port(program):
    with on_a_serial_port(program) as channel:
        yield channel


def plant_at(channel, model, period=0.0, rows=None, timeout=20.0):
    known = {"length": model.length, "reach": model.reach}
    rows = rows or model.rows
    return DevicePlant(Wire(channel, rows, period), rows, model.rest_e, timeout, period, **known)


class Listener:
    """Frames at a channel, one by one."""

    def __init__(self, channel):
        self.channel, self.receiver, self.came = channel, Receiver(), []

    def tell(self, frame):
        self.channel.write(frame.packed())

    def next(self):
        wait_for(lambda: self.came or self.came.extend(self.receiver.feed(self.channel.read(0.05))))
        return self.came.pop(0)

    def until(self, kind):
        while (frame := self.next()).kind != kind:
            pass
        return frame


COMMANDS = [(4.0, 3.5), (9.0, 1.0), (0.5, 12.0)]


class Board:
    """A channel in memory to a device of one effector, one actuator and two markers, of which it does not see the
    second."""

    where, rows = "device in memory", Rows(("tip.x", "tip.y", "tip.z"), ("pull",))

    def __init__(self):
        self.receiver, self.bytes, self.sent = Receiver(), b"", 0

    def open(self):
        pass

    close = open

    def write(self, data):
        answers = {Kind.HELLO: self.ready, Kind.DISPLACEMENT: self.answer}
        for frame in self.receiver.feed(data):
            if frame.kind in answers:
                self.sent += 1
                self.bytes += answers[frame.kind](frame).packed()

    def ready(self, hello):
        return Frame(Kind.READY, robot_checksum(self.rows), (3.0, 1.0, 2.0, float(TAKES[Kind.DISPLACEMENT])), self.sent)

    def answer(self, command):
        payload = (1.0, 2.0, 3.0, *command.payload, 0.5, 7.0, 8.0, 9.0, *[np.nan] * 3)
        return Frame(Kind.ANSWER, command.tick, payload, self.sent)

    def read(self, timeout):
        data, self.bytes = self.bytes, b""
        return data


def test_markers_follow_the_forces_in_an_answer():
    wire = Wire(Board(), Board.rows)
    wire.ask({"hello": 1, "rest_e": [0.0, 0.0, 0.0], "markers": ["top", "side"]}, 1.0)
    answer = wire.ask({"t": 1, "kind": "displacement", "u": [4.0]}, 1.0)
    assert answer["x_e"] == [1.0, 2.0, 3.0] and answer["delta_a"] == [4.0] and answer["lambda_a"] == [0.5]
    assert answer["markers"] == {"top": [7.0, 8.0, 9.0], "side": None}


@pytest.mark.parametrize("at", [on_a_serial_port, on_udp])
def test_a_board_at_a_wire_is_a_plant(program, model, at):
    with at(program) as channel, plant_at(channel, model) as plant:
        for t, u in enumerate(COMMANDS, 1):
            measured = plant.step(np.array(u))
            expected = model.at_displacement(np.array(u))
            assert measured.t == t and measured.status == "converged"
            assert measured.x_e == pytest.approx(model.rest_e + expected.delta_e, abs=SINGLE)
            assert measured.delta_a == pytest.approx(u, abs=SINGLE)
            assert measured.lambda_a == pytest.approx(expected.lam, abs=SINGLE)
        assert plant.losses == {"missed": 0, "stops": 0, "skipped": 0}


def test_nothing_is_commanded_beyond_the_bounds(port, model):
    low, high = model.reach.T
    with plant_at(port, model) as plant:
        assert plant.step(np.array([1e3, -1e3])).delta_a == pytest.approx([high[0], low[1]], abs=SINGLE)
        with pytest.raises(InputError, match="takes displacements and goals, and is told forces"):
            plant.step(np.ones(2), "force")


def test_a_command_that_is_no_number_is_not_heeded(port, model):
    with plant_at(port, model, timeout=0.2) as plant:
        plant.step(np.array([4.0, 3.5]))
        plant.step(np.array([np.nan, 3.5]))
        assert plant.losses["missed"] == 1
        assert plant.step(np.array([5.0, 3.5])).delta_a == pytest.approx([5.0, 3.5], abs=SINGLE)


def test_one_of_another_robot_is_refused(port, model):
    for rows, words in [
        (Rows(("x",), ("a",)), r"has \[3, 2, 0\] effector rows, actuators and markers, and the robot \[1, 1, 0\]"),
        (Rows(model.rows.effectors, ("b", "a")), "effectors and actuators have other names"),
    ]:
        with pytest.raises(InputError, match=words) as caught, plant_at(port, model, rows=rows):
            pass
        assert "device on serial port" in str(caught.value)


def test_a_port_that_is_not_there_and_one_where_nobody_answers(model, monkeypatch):
    with pytest.raises(InputError, match="cannot be started"), plant_at(SerialChannel("/dev/none", 9600), model):
        pass
    monkeypatch.setattr(device_plant, "FIRST_TIMEOUT", 0.2)
    with pytest.raises(InputError, match=r"UDP 127.0.0.1:9: gave no answer within 0\.2 s") as caught:
        plant_at(UdpChannel("127.0.0.1", 9), model).__enter__()
    assert "docs/closed-loop.md" in str(caught.value)


def test_the_watchdog_stops_within_three_ticks_and_the_next_command_is_heeded(port, model):
    """The board's clock goes on only while it hears nothing."""
    port.open()
    rest = tuple(model.rest_e)
    said = Listener(port)
    said.tell(Frame(Kind.HELLO, 0, (TICK, *rest), 1))
    said.until(Kind.READY)
    said.tell(Frame(Kind.DISPLACEMENT, 7, (4.0, 3.5), 2))
    answer, stopped = said.until(Kind.ANSWER), said.until(Kind.STOPPED)
    assert stopped.tick == answer.tick == 7
    assert 2 * TICK < (stopped.stamp - answer.stamp) * 1e-6 <= 3 * TICK
    said.tell(Frame(Kind.DISPLACEMENT, 8, (4.0, 3.5), 1))  # of any sequence, as nothing was heard for a while
    assert said.until(Kind.ANSWER).payload[3:5] == pytest.approx([4.0, 3.5])
    port.close()


def test_what_comes_twice_has_the_same_answer_and_what_comes_too_late_none(port, model):
    port.open()
    said = Listener(port)
    said.tell(Frame(Kind.HELLO, 0, (1.0, *model.rest_e), 65534))
    said.until(Kind.READY)
    frames = [Frame(Kind.GOAL, 0, (*(model.rest_e + k), *model.rest_e), 65534 + k) for k in (1, 2, 3)]
    for k in (0, 1, 1, 0, 2):
        said.tell(frames[k])
    first, second, again, third = (said.until(Kind.COMMAND) for _ in range(4))
    assert [one.tick for one in (first, second, again, third)] == [1, 2, 2, 3] and again == second
    said.tell(Frame(Kind.BYE, 0, (), 5))
    said.tell(Frame(Kind.DISPLACEMENT, 9, (1.0, 1.0), 6))  # after goodbye nothing is heeded
    said.tell(Frame(Kind.HELLO, 0, (1.0, *model.rest_e), 7))
    assert said.next().kind == Kind.READY
    port.close()


def test_the_board_runs_the_controller_as_it_does_here(program, port, model):
    wire, here = Wire(port, model.rows), CompiledController(program.parent)
    wire.start()
    wire.ask({"hello": "", "rest_e": model.rest_e}, 20.0)
    real, measured, sample = ModelPlant(Stiffer(model, 1.2), model.rest_e), None, 0
    for angle in np.linspace(0, 2 * np.pi, 30):
        goal = model.rest_e + model.at_displacement([6 + 3 * np.cos(angle), 6 + 3 * np.sin(angle)]).delta_e
        seen = None if measured is None else np.float32(measured).astype(float)
        expected = here.step(np.float32(goal).astype(float), seen, sample)
        told = wire.ask({"goal": goal, "x_e": measured, "t": sample}, 20.0)
        assert told["status"] == expected.status and told["t"] == expected.tick
        assert told["delta_a"] == pytest.approx(expected.delta_a, rel=1e-6)
        measured, sample = real.step(np.array(told["delta_a"])).x_e, told["t"]
    wire.end()


@pytest.mark.parametrize("share", [0.01, pytest.param(0.03, marks=pytest.mark.slow)])
def test_a_loop_over_a_bad_wire_goes_on_and_reaches_its_goal(port, model, share):
    """One byte in a hundred, each way: about half of the exchanges lose a frame."""
    controller = make_controller(model, command="displacement")
    goal = model.rest_e + model.at_displacement([6.0, 5.0]).delta_e
    measured, told = None, []
    with plant_at(BadWire(port, share, 3), model, period=TICK) as plant:
        for _ in range(60):
            measured = plant.step(controller.tick(goal, measured).u)
            if measured.delta_a is not None:
                told.append(measured.delta_a)
        losses = plant.losses
    low, high = model.reach.T
    assert (np.array(told) >= low - SINGLE).all() and (np.array(told) <= high + SINGLE).all()
    assert losses["missed"] > 5 and losses["skipped"] > 100 and measured.t > 30
    assert np.linalg.norm(measured.x_e - goal) < 0.01


def test_silence_ends_the_run(port, model):
    with plant_at(BadWire(port, 0.0, 0), model, period=TICK, timeout=0.1) as plant:
        plant.step(np.ones(2))
        plant.transport._channel.spoilt = lambda data: b""
        with pytest.raises(InputError, match=r"gave no answer within 0\.1 s"):
            for _ in range(20):
                plant.step(np.ones(2))


OFFSET = np.array([1.0, -0.5, 0.8])  # mm, of the real robot from its model
LAP = 100  # ticks


def tracked(channel, model, period):
    """(2 LAP,) mm errors of a board that runs the controller, along a closed curve of a robot that stands beside its
    model; commands (2 LAP, 2); the wire's losses."""
    wire, real = Wire(channel, model.rows, period), ModelPlant(model, model.rest_e + OFFSET)
    wire.start()
    wire.ask({"hello": "", "rest_e": model.rest_e}, 20.0)
    measured, sample, u, errors, commands = None, 0, np.zeros(2), [], []
    for k in range(2 * LAP):
        angle = 2 * np.pi * k / LAP
        wanted = model.at_displacement([9 + 1.5 * np.cos(angle), 9 + 1.5 * np.sin(angle)]).delta_e
        goal = model.rest_e + OFFSET + wanted
        if told := wire.ask({"goal": goal, "x_e": measured, "t": sample}, 20.0):
            u, sample = np.array(told["delta_a"]), told["t"]
            measured = real.step(u).x_e
        errors.append(np.linalg.norm(real.step(u).x_e - goal))
        commands.append(u)
    wire.end()
    return np.array(errors), np.array(commands), wire.losses()


@pytest.mark.slow
@pytest.mark.parametrize("cpu", ["m7", "m4"])
@pytest.mark.parametrize(("share", "period"), [(0.0, 2.0), (0.01, 0.3)])
def test_an_emulated_board_tracks_a_closed_curve(program, model, cpu, share, period):
    """Without feedback the robot would be beside the curve by its offset, 1.4 mm. Ticks are so long that a busy machine
    misses none; they end when the answer comes. On a bad wire the board stops now and then, which takes the robot home,
    and comes back to the curve."""
    with on_an_emulated_board(program.parent, cpu) as channel:
        errors, commands, losses = tracked(BadWire(channel, share, 2), model, period)
    errors = errors[LAP:]
    rms, median = np.sqrt(np.mean(errors**2)), np.median(errors)
    print(f"Cortex-{cpu.upper()}, {share:.0%} of bytes damaged: rms {rms:.1g} mm, median {median:.1g} mm, {losses}")
    low, high = model.reach.T
    assert (commands >= low - SINGLE).all() and (commands <= high + SINGLE).all()
    assert median < 0.01 and np.mean(errors < 1.0) > 0.8
    assert share or (rms < 0.01 and losses == {"missed": 0, "stops": 0, "skipped": 0})
