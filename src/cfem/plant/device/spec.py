"""Spec of a device: a program, a serial port, a port of UDP, or motors."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, NonNegativeInt, PositiveInt

from cfem.condensed import Rows
from cfem.core.errors import SpecError
from cfem.core.names import Name
from cfem.core.optional import demand
from cfem.core.spec import Spec
from cfem.core.units import Length
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


class MotorSpec(Spec):
    """The motor of a cable."""

    id: Annotated[NonNegativeInt, Field(le=252)]
    """Number of the motor on the bus."""
    spool: Annotated[Length, Field(gt=0)]
    """Effective radius of its spool: to the middle of the cable."""
    reversed: bool = False
    """True: the motor winds the cable while its position falls."""
    zero: int | None = None
    """Position in counts where the robot is at rest and the cable taut. Where the motor stands at the start of each
    run unless given."""


class DynamixelSpec(Spec):
    """Dynamixel motors of the X series (Protocol 2.0) on a serial port, each of which winds a cable on a spool."""

    kind: Literal["dynamixel"]
    """Dynamixel motors."""
    port: str = Field(min_length=1)
    """The port, as /dev/ttyUSB0 or COM3."""
    baud: PositiveInt = 57600
    """Bits a second."""
    counts: PositiveInt = 4096
    """Positions of a turn."""
    motors: dict[Name, MotorSpec] = Field(min_length=1)
    """Motor of each cable."""

    def check(self) -> None:
        ids = [motor.id for motor in self.motors.values()]
        if len(set(ids)) < len(ids):
            raise ValueError("two motors have the same id")


DeviceSpec = Annotated[ProgramSpec | SerialPortSpec | UdpSpec | DynamixelSpec, Field(discriminator="kind")]


def transport_of(spec: DeviceSpec, rows: Rows, folder: Path | None, period: float) -> Transport:
    """Transport of messages to a device. rows: of the robot; folder: where a program starts; period: s of a tick."""
    if spec.kind == "program":
        return Lines(spec.command, folder)
    if spec.kind == "dynamixel":
        return _motors(spec, rows, period)
    from cfem.plant.device.channel import SerialChannel, UdpChannel
    from cfem.plant.device.wire import Wire

    if spec.kind == "udp":
        return Wire(UdpChannel(spec.host, spec.port), rows, period)
    demand("serial", where="loop.device: serial")
    return Wire(SerialChannel(spec.port, spec.baud), rows, period)


def _motors(spec: DynamixelSpec, rows: Rows, period: float) -> Transport:
    """SpecError where the motors are of other cables than the robot's, or their package is not installed."""
    from cfem.plant.device.dynamixel import Dynamixel, Motor

    where = "loop.device: dynamixel"
    demand("dynamixel_sdk", where=where)
    if set(spec.motors) != set(rows.actuators):
        what = f"has motors of {', '.join(spec.motors)}, and the robot the cables {', '.join(rows.actuators)}"
        raise SpecError(what, where=where, do="name one motor for each cable")
    stated = {name: spec.motors[name] for name in rows.actuators}
    motors = {name: Motor(motor.id, motor.spool, motor.reversed, motor.zero) for name, motor in stated.items()}
    return Dynamixel(spec.port, spec.baud, motors, spec.counts, period)
