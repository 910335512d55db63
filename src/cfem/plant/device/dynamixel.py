"""A device that is a chain of Dynamixel motors (Protocol 2.0, X series), each of which winds a cable on a spool."""

import math
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from cfem.plant.device.answer import Malformed
from cfem.plant.device.device_plant import VERSION

# Control table of the X series: address and bytes.
OPERATING_MODE, TORQUE, HARDWARE_ERROR, WATCHDOG = (11, 1), (64, 1), (70, 1), (98, 1)
GOAL, POSITION = (116, 4), (132, 4)
EXTENDED_POSITION = 4  # operating mode: of many turns
FARTHEST = 1_048_575  # counts, of that mode
ERRORS = {0: "input voltage", 2: "overheating", 3: "encoder", 4: "electrical shock or low power", 5: "overload"}
ALERT = 0x80  # of a status packet: the motor has a hardware error
TRIES = 3  # of a packet that is not answered
WATCHDOG_STEP, WATCHDOG_MOST = 0.02, 127  # s; steps
RELEASE, UNWOUND = 2.0, 20  # s that unwinding may take; counts from rest that are unwound


@dataclass(frozen=True)
class Motor:
    """Motor of a cable.

    id: on the bus
    spool: mm, effective radius
    reversed: whether the cable is wound where positions fall
    zero: counts where the robot is at rest, those at hello unless given"""

    id: int
    spool: float
    reversed: bool = False
    zero: int | None = None


class Dynamixel:
    """Messages of `DevicePlant` to a chain of motors: displacements become positions, spool radius times angle.

    The robot is at rest at hello. A bus watchdog stops the motors where no command comes for longer than the device
    may be silent. The end unwinds the cables, then lets go."""

    def __init__(self, port: str, baud: int, motors: dict[str, Motor], counts: int = 4096, period: float = 0.0):
        """motors: by cable, in the order of the robot's actuators; counts: of a turn; period: s of a tick."""
        self._motors, self._names = list(motors.values()), list(motors)
        signs = np.array([-1.0 if motor.reversed else 1.0 for motor in self._motors])
        self._counts_per_mm = signs * counts / (2 * np.pi * np.array([motor.spool for motor in self._motors]))
        self._name, self._baud, self._period = port, baud, period
        self._port = self._packets = self._zero = None
        self._told, self._silence, self._missed = -math.inf, 0.0, 0
        self.where = f"Dynamixel motors on serial port {port}"

    def start(self) -> None:
        """OSError where the port cannot be opened."""
        from dynamixel_sdk import PacketHandler, PortHandler

        port = PortHandler(self._name)
        if not port.setBaudRate(self._baud):
            raise OSError(f"{self._baud} is no baud rate of Dynamixel motors")
        self._port, self._packets = port, PacketHandler(2.0)

    def ask(self, message: dict[str, Any], timeout: float) -> dict[str, Any]:
        """Answer to hello or to a command. Malformed where a motor is silent, reports an error, or is told what it
        cannot do."""
        try:
            return self._greeted() if "hello" in message else self._moved(message, timeout)
        except OSError as error:
            raise Malformed(f"is gone: {error.strerror or error}") from error

    def losses(self) -> dict[str, int]:
        """missed: packets that were not answered, and sent again."""
        return {"missed": self._missed}

    def end(self) -> None:
        """Unwinds the cables, lets go of the motors and closes the port."""
        if self._port is None:
            return
        with suppress(OSError, Malformed):
            self._unwind()
        for motor in self._motors:  # whatever the others say
            with suppress(OSError, Malformed):
                self._write(motor, TORQUE, 0)
        with suppress(OSError):
            self._port.closePort()

    def _unwind(self) -> None:
        if self._zero is None:
            return
        end = time.monotonic() + RELEASE
        self._arm(RELEASE)
        self._send(self._zero)
        while time.monotonic() < end and np.abs(self._positions() - self._zero).max() > UNWOUND:
            self._send(self._zero)

    def _greeted(self) -> dict[str, Any]:
        """Answer to hello: the motors hold where they stand, which is the robot at rest."""
        for name, motor in zip(self._names, self._motors, strict=True):
            if not any(self._packets.ping(self._port, motor.id)[1] == 0 for _ in range(TRIES)):
                others = ", ".join(map(str, sorted(self._packets.broadcastPing(self._port)[0]))) or "none"
                what = f"no motor with id {motor.id} (cable {name}) answers at {self._baud} baud"
                raise Malformed(f"{what}; ids that answer: {others}")
            self._write(motor, TORQUE, 0)
            self._write(motor, WATCHDOG, 0)
            self._write(motor, OPERATING_MODE, EXTENDED_POSITION)
        positions = self._positions()
        stated = [motor.zero for motor in self._motors]
        self._zero = np.array([now if zero is None else zero for zero, now in zip(stated, positions, strict=True)])
        for motor in self._motors:
            self._write(motor, TORQUE, 1)
        return {"ready": True, "version": VERSION}

    def _moved(self, message: dict[str, Any], timeout: float) -> dict[str, Any]:
        """Answer to a command: where the motors were right after it."""
        if message["kind"] != "displacement":
            raise Malformed("takes displacements of cables, and is told forces: take loop.command displacement")
        goal = np.rint(self._zero + self._counts_per_mm * np.array(message["u"]))
        if np.abs(goal).max() > FARTHEST:
            cable = self._names[int(np.abs(goal).argmax())]
            raise Malformed(f"cable {cable} is told a position beyond the {FARTHEST} counts that its motor counts to")
        if time.monotonic() - self._told > self._silence:
            self._arm(max(timeout, 3 * self._period))
        self._send(goal)
        delta_a = (self._positions() - self._zero) / self._counts_per_mm
        return {"t": message["t"], "x_e": None, "delta_a": delta_a.tolist()}

    def _arm(self, silence: float) -> None:
        """Lets the motors stop after `silence` seconds without a packet; those that have stopped go on."""
        steps = min(max(math.ceil(silence / WATCHDOG_STEP), 1), WATCHDOG_MOST)
        for value in (0, steps):
            for motor in self._motors:
                self._write(motor, WATCHDOG, value)
        self._silence = steps * WATCHDOG_STEP

    def _send(self, goal: np.ndarray) -> None:
        """All goals (counts) in one packet, which no motor answers."""
        data = [
            byte
            for motor, counts in zip(self._motors, goal, strict=True)
            for byte in (motor.id, *int(counts).to_bytes(GOAL[1], "little", signed=True))
        ]
        self._packets.syncWriteTxOnly(self._port, *GOAL, data, len(data))
        self._told = time.monotonic()

    def _positions(self) -> np.ndarray:
        """Positions (counts) of all motors."""
        from dynamixel_sdk import COMM_RX_CORRUPT

        def read() -> tuple[list[int] | None, int]:
            ids = [motor.id for motor in self._motors]
            result = self._packets.syncReadTx(self._port, *POSITION, ids, len(ids), False)
            positions = []
            for name, motor in zip(self._names, self._motors, strict=True):
                if result:
                    return None, result
                data, result, error = self._packets.readRx(self._port, motor.id, POSITION[1])
                if not result:
                    self._demand_sound(name, motor, error)
                    if len(data) != POSITION[1]:  # a late answer to another packet
                        return None, COMM_RX_CORRUPT
                    positions.append(int.from_bytes(bytes(data), "little", signed=True))
            return positions, result

        return np.array(self._answered(read, "not every motor answers"), float)

    def _write(self, motor: Motor, place: tuple[int, int], value: int) -> None:
        """Writes one byte to a motor's control table, at (address, size) `place`."""
        name = self._names[self._motors.index(motor)]

        def write() -> tuple[None, int]:
            result, error = self._packets.write1ByteTxRx(self._port, motor.id, place[0], value)
            if not result:
                self._demand_sound(name, motor, error)
            return None, result

        self._answered(write, f"motor {motor.id} (cable {name}) does not answer any more")

    def _answered(self, exchange: Callable[[], tuple[Any, int]], silent: str) -> Any:
        """Result of an exchange of packets, which is tried again where an answer is lost."""
        for _ in range(TRIES):
            answer, result = exchange()
            if not result:
                return answer
            self._missed += 1
        raise Malformed(f"{silent}: {self._packets.getTxRxResult(result).removeprefix('[TxRxResult] ')}")

    def _demand_sound(self, name: str, motor: Motor, error: int) -> None:
        """Malformed where the error of a status packet is one."""
        if error & ALERT:
            bits = self._answered(
                lambda: self._packets.read1ByteTxRx(self._port, motor.id, HARDWARE_ERROR[0])[:2],
                f"motor {motor.id} (cable {name}) reports a hardware error, and does not say which",
            )
            named = [what for bit, what in ERRORS.items() if bits >> bit & 1]
            what = f"motor {motor.id} (cable {name}) reports {' and '.join(named) or 'a hardware error'}"
            raise Malformed(f"{what}: relieve it, then switch it off and on")
        if error:
            message = self._packets.getRxPacketError(error).removeprefix("[RxPacketError] ")
            raise Malformed(f"motor {motor.id} (cable {name}) refuses: {message}")
