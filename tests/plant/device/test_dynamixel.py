"""Dynamixel motors as a device, by the SDK of their maker, against an emulated chain."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError
from surrogate.synthetic import dataset

from cfem.core.errors import InputError, SpecError
from cfem.plant.device import dynamixel
from cfem.plant.device.answer import Malformed
from cfem.plant.device.device_plant import DevicePlant
from cfem.plant.device.spec import DeviceSpec, transport_of

pytest.importorskip("dynamixel_sdk", reason="needs dynamixel-sdk")
pytestmark = pytest.mark.skipif("not hasattr(__import__('os'), 'openpty')", reason="needs a pty")
from plant.device.dynamixel_chain import EmulatedMotor, chain, crc  # noqa: E402

TRIES = dynamixel.TRIES  # before any test is patient
COUNT = 2 * math.pi * 12 / 4096  # mm of the larger spool


@pytest.fixture(autouse=True)
def patient(monkeypatch):
    """The SDK waits some 35 ms for a packet, which a busy machine may take."""
    monkeypatch.setattr(dynamixel, "TRIES", 30)


@pytest.fixture
def motors():
    return {1: EmulatedMotor(2048), 4: EmulatedMotor(-1000)}


def spec_of(port, rows, **changed):
    left, right = rows.actuators
    motors = {
        right: {"id": 4, "spool": "12 mm", "reversed": True},
        left: {"id": 1, "spool": "10 mm"},
    }
    return TypeAdapter(DeviceSpec).validate_python({"kind": "dynamixel", "port": port, "motors": motors, **changed})


def plant_at(port, timeout=1.0, **changed):
    robot = dataset(1, 0, 2)
    transport = transport_of(spec_of(port, robot.rows, **changed), robot.rows, None, 0.0)
    return DevicePlant(transport, robot.rows, np.zeros(robot.rows.n_e), timeout)


def test_displacements_become_angles_of_the_spools(motors):
    with chain(motors) as port:
        with plant_at(port) as plant:
            assert [motor.at(11, 1) for motor in motors.values()] == [4, 4]  # of many turns
            for t, u in enumerate([(5.0, 0.0), (2 * math.pi * 10, 8.0), (-1.0, 100.0)], 1):
                measured = plant.step(np.array(u))
                assert measured.t == t and measured.delta_a == pytest.approx(u, abs=0.51 * COUNT)
                assert np.isnan(measured.x_e).all()
            assert motors[1].goals[1] == 2048 + 4096  # a turn
            assert motors[4].goals[1] == round(-1000 - 8.0 / (2 * math.pi * 12) * 4096)
            assert 1 <= motors[1].at(98, 1) <= 127  # the watchdog
        assert [motor.at(132, 4) for motor in motors.values()] == [2048, -1000]  # unwound
        assert [motor.at(64, 1) for motor in motors.values()] == [0, 0]  # and let go


def test_stated_zeros_are_where_the_robot_rests(motors):
    rows = dataset(1, 0, 2).rows
    stated = {
        name: {"id": number, "spool": "10 mm", "zero": 100} for name, number in zip(rows.actuators, (1, 4), strict=True)
    }
    with chain(motors) as port, plant_at(port, motors=stated) as plant:
        plant.step(np.zeros(2))
        assert [motor.goals for motor in motors.values()] == [[100], [100]]


def test_a_lost_packet_is_sent_again(motors):
    with chain(motors) as port, plant_at(port) as plant:
        plant.step(np.array([1.0, 1.0]))
        motors[4].deaf = 2  # the goals, and the first question
        assert plant.step(np.array([2.0, 1.0])).delta_a == pytest.approx([2.0, 1.0], abs=COUNT)
        assert plant.losses["missed"] >= 1


def fails(port, what, u=(1.0, 1.0), kind="displacement", spoil=lambda: None, **changed):
    with pytest.raises(InputError, match=what), plant_at(port, **changed) as plant:
        plant.step(np.array([0.5, 0.5]))
        spoil()
        plant.step(np.array(u), kind)


def test_what_is_wrong_is_said_in_a_sentence(motors):
    rows = dataset(1, 0, 2).rows
    left, right = rows.actuators
    with chain(motors) as port:
        absent = {left: {"id": 1, "spool": "10 mm"}, right: {"id": 7, "spool": "10 mm"}}
        fails(
            port, rf"no motor with id 7 \(cable {right}\) answers at 57600 baud; ids that answer: 1, 4", motors=absent
        )
        fails(port, "1234 is no baud rate", baud=1234)
        fails(port, "takes displacements of cables, and is told forces", kind="force")
        fails(port, rf"cable {left} is told a position beyond", u=(1e5, 0.0))
        fails(
            port,
            rf"motor 4 \(cable {right}\) reports overheating and overload: relieve it",
            spoil=lambda: motors[4].put(70, 1, 0b100100),
        )
        assert [motor.at(64, 1) for motor in motors.values()] == [0, 0]  # let go, whatever it was


def test_a_chain_that_falls_silent_ends_the_run(motors, monkeypatch):
    def unplug():
        motors[1].deaf = 1000
        monkeypatch.setattr(dynamixel, "TRIES", 3)

    with chain(motors) as port:
        fails(port, "not every motor answers: There is no status packet", spoil=unplug)
        assert motors[4].at(64, 1) == 0


def test_without_a_port_it_does_not_start(tmp_path):
    fails(str(tmp_path / "none"), "cannot be started: .*No such file")


def test_a_watchdog_that_has_stopped_the_motors_is_cleared(motors, monkeypatch):
    with chain(motors) as port, plant_at(port, timeout=0.1) as plant:
        plant.step(np.array([1.0, 1.0]))
        for motor in motors.values():
            motor.put(98, 1, 255)
        monkeypatch.setattr(plant.transport, "_told", -math.inf)  # a long silence
        plant.step(np.array([2.0, 2.0]))
        assert motors[1].at(98, 1) == 5 and motors[1].at(132, 4) > 2048 + 1.9 / 10 / (2 * math.pi) * 4096


def test_motors_are_those_of_the_robot():
    rows = dataset(1, 0, 2).rows
    with pytest.raises(ValidationError, match="same id"):
        spec_of("p", rows, motors={name: {"id": 1, "spool": "10 mm"} for name in rows.actuators})
    other = spec_of("p", rows, motors={"thumb": {"id": 1, "spool": "10 mm"}})
    with pytest.raises(SpecError, match=f"has motors of thumb, and the robot the cables {', '.join(rows.actuators)}"):
        transport_of(other, rows, None, 0.0)


def test_the_checksum_is_that_of_the_description():
    """The example of a ping of motor 1 in the description of the protocol."""
    assert crc(bytes.fromhex("fffffd00010300 01".replace(" ", ""))) == 0x4E19


@pytest.mark.parametrize(("silent", "asked"), [(0, 1), (2, 3), (3, 3)])
def test_an_answer_that_is_lost_is_asked_for_twice_more(monkeypatch, silent, asked):
    monkeypatch.setattr(dynamixel, "TRIES", TRIES)
    device, results = object.__new__(dynamixel.Dynamixel), [*[1] * silent, 0, 0]
    device._missed, device._packets = 0, SimpleNamespace(getTxRxResult=lambda result: f"[TxRxResult] result {result}")
    exchanges = []

    def exchange():
        exchanges.append(results[len(exchanges)])
        return "answer", exchanges[-1]

    if silent < 3:
        assert device._answered(exchange, "motor 1 is silent") == "answer"
    else:
        with pytest.raises(Malformed, match="motor 1 is silent: result 1"):
            device._answered(exchange, "motor 1 is silent")
    assert len(exchanges) == asked and device._missed == silent
