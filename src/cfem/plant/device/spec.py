"""What control.yaml says of a device: a program, a serial port, or a port of UDP."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, PositiveInt

from cfem.condensed import Rows
from cfem.core.optional import demand
from cfem.core.spec import Spec
from cfem.plant.device.device_plant import Transport
from cfem.plant.device.lines import Lines


class ProgramSpec(Spec):
    """A program that exchanges lines of JSON on its standard input and output."""

    kind: Literal["program"]
    """A program."""
    command: list[str] = Field(min_length=1)
    """The program and its arguments. It starts in the folder of the spec."""


class SerialPortSpec(Spec):
    """A board on a serial port, which exchanges frames."""

    kind: Literal["serial"]
    """A serial port."""
    port: str = Field(min_length=1)
    """The port, as /dev/ttyUSB0 or COM3."""
    baud: PositiveInt = 115200
    """Bits a second."""


class UdpSpec(Spec):
    """A board in the network, which exchanges frames, each in a datagram."""

    kind: Literal["udp"]
    """A port of UDP."""
    host: str = Field(min_length=1)
    """Name or address of the board."""
    port: Annotated[int, Field(ge=1, le=65535)]
    """The port on which it listens."""


DeviceSpec = Annotated[ProgramSpec | SerialPortSpec | UdpSpec, Field(discriminator="kind")]


def transport_of(spec: DeviceSpec, rows: Rows, folder: Path | None, period: float) -> Transport:
    """Transport of messages to a device. rows: of the robot; folder: where a program starts; period: s of a tick."""
    if spec.kind == "program":
        return Lines(spec.command, folder)
    from cfem.plant.device.channel import SerialChannel, UdpChannel
    from cfem.plant.device.wire import Wire

    if spec.kind == "udp":
        return Wire(UdpChannel(spec.host, spec.port), rows, period)
    demand("serial", where="loop.device: serial")
    return Wire(SerialChannel(spec.port, spec.baud), rows, period)
