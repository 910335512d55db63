"""The template of a pressure regulator, which cfem starts as a device, against an emulated one."""

import os
import sys
import threading
import tty
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from surrogate.synthetic import dataset

from cfem.core.errors import InputError
from cfem.plant.device.device_plant import DevicePlant
from cfem.plant.device.lines import Lines

pytest.importorskip("serial")
pytestmark = pytest.mark.skipif("not hasattr(os, 'openpty')", reason="needs a pty")
PROGRAM = Path(__file__).parents[3] / "examples" / "pressure_regulator.py"


class EmulatedRegulator:
    """A sensor of its own reads 0.2 kPa too little, if any. answers: what it says in place of the truth, by channel."""

    def __init__(self):
        self.kpa, self.answers, self.lines = {}, {}, []

    def serve(self, wire):
        heard = b""
        while True:
            try:
                heard += os.read(wire, 1024)
            except OSError:
                return
            *lines, heard = heard.split(b"\n")
            for line in map(bytes.decode, lines):
                if line == "END":
                    return
                channel, pressure = int(line[1 : line.index(" ")]), float(line.split()[1])
                self.lines.append(line)
                self.kpa[channel] = pressure
                said = self.answers.get(channel, f"OK {max(pressure - 0.2, 0.0):.1f}\n")
                os.write(wire, said.encode())


@pytest.fixture
def regulator():
    return EmulatedRegulator()


@contextmanager
def on_a_port(regulator):
    wire, port = os.openpty()
    tty.setraw(port)
    thread = threading.Thread(target=regulator.serve, args=(wire,))
    thread.start()
    try:
        yield os.ttyname(port)
    finally:
        os.write(port, b"END\n")
        thread.join(60)
        os.close(port), os.close(wire)


def plant_at(port, *options):
    rows = dataset(1, 0, 2).rows
    command = [sys.executable, "-P", str(PROGRAM), "--port", port, "--within", "5", *options]
    return DevicePlant(Lines(command), rows, np.zeros(rows.n_e), 60.0)


def test_pressures_arrive_and_are_vented(regulator):
    with on_a_port(regulator) as port:
        with plant_at(port) as plant:
            measured = plant.step(np.array([0.05, 0.12]), "force")
            assert measured.lambda_a == pytest.approx([0.0498, 0.1198]) and np.isnan(measured.x_e).all()
        assert regulator.lines == ["P1 0.0", "P2 0.0", "P1 50.0", "P2 120.0", "P1 0.0", "P2 0.0"]


def fails(port, what, u=(0.05, 0.12), kind="force", options=(), spoil=lambda: None):
    with pytest.raises(InputError, match=what), plant_at(port, *options) as plant:
        spoil()
        plant.step(np.array(u), kind)


def test_what_is_wrong_is_said_in_a_sentence_and_vented(regulator, tmp_path):
    with on_a_port(regulator) as port:
        fails(port, "this regulator sets pressures: take loop.command force", kind="displacement")
        fails(port, "channel 2 is told 0.3 MPa, and may have 0 to 0.2 MPa", u=(0.05, 0.3))
        for said, what in {
            "ERR overload\n": "channel 2 of the regulator reports: overload",
            "hello\n": "the regulator answered 'hello' to 'P2 120.0', expected OK and kPa",
            "OK many\n": "the regulator answered 'OK many'",
        }.items():
            regulator.answers.clear()
            fails(port, what, spoil=lambda said=said: regulator.answers.update({2: said}))
        regulator.answers = {2: ""}
        fails(port, "the regulator gave no answer to 'P2 0.0' within 0.1 s", options=("--within", "0.1"))
        assert set(regulator.kpa.values()) == {0.0}
    fails(str(tmp_path / "none"), "reports: .*could not open port")
