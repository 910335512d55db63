"""An emulated chain of Dynamixel motors behind a pseudo-terminal, written after the description of Protocol 2.0
(emanual.robotis.com/docs/en/dxl/protocol2) and the control table of the X series, and not after the SDK."""

import os
import threading
import tty
from contextlib import contextmanager

PING, READ, WRITE, STATUS, SYNC_READ, SYNC_WRITE, EVERYBODY = 0x01, 0x02, 0x03, 0x55, 0x82, 0x83, 0xFE
HEAD = b"\xff\xff\xfd\x00"
ACCESS, RANGE, ALERT = 7, 4, 0x80


def crc(data: bytes) -> int:
    """CRC-16 of the polynomial x^16 + x^15 + x^2 + 1, from 0."""
    register = 0
    for byte in data:
        register ^= byte << 8
        for _ in range(8):
            register = (register << 1 ^ (0x8005 if register & 0x8000 else 0)) & 0xFFFF
    return register


class EmulatedMotor:
    """Stands at its goal as soon as torque is on. table: its control table; deaf: packets that it does not hear."""

    def __init__(self, position: int):
        self.table, self.deaf, self.goals = bytearray(147), 0, []
        self.put(132, 4, position)
        self.put(11, 1, 3)

    def at(self, address: int, size: int) -> int:
        return int.from_bytes(self.table[address : address + size], "little", signed=size == 4)

    def put(self, address: int, size: int, value: int) -> None:
        self.table[address : address + size] = value.to_bytes(size, "little", signed=value < 0)

    def write(self, address: int, data: bytes) -> int:
        """Error of the status packet."""
        if address == 11 and self.at(64, 1):
            return ACCESS
        if address == 116 and not self.at(64, 1):
            return 0
        if address == 116 and self.at(98, 1) == 255:
            return RANGE
        self.table[address : address + len(data)] = data
        if address == 116:
            self.table[132:136] = data
            self.goals.append(self.at(116, 4))
        return 0

    @property
    def alert(self) -> int:
        return ALERT if self.table[70] else 0


class Chain:
    """Motors by id, which answer what comes to `wire`."""

    def __init__(self, motors: dict[int, EmulatedMotor], wire: int):
        self.motors, self.wire, self.bytes = motors, wire, b""

    def serve(self) -> None:
        while True:
            try:
                data = os.read(self.wire, 4096)
            except OSError:
                return
            if not data:
                return
            self.bytes += data
            while packet := self.next():
                self.heed(*packet)

    def next(self) -> tuple[int, int, bytes] | None:
        """Id, instruction and parameters of the next packet."""
        start = self.bytes.find(HEAD)
        if start < 0 or len(self.bytes) < start + 7:
            return None
        length = int.from_bytes(self.bytes[start + 5 : start + 7], "little")
        packet = self.bytes[start : start + 7 + length]
        if len(packet) < 7 + length:
            return None
        self.bytes = self.bytes[start + 7 + length :]
        assert crc(packet[:-2]) == int.from_bytes(packet[-2:], "little")
        inner = packet[7:-2].replace(b"\xff\xff\xfd\xfd", b"\xff\xff\xfd")
        return packet[4], inner[0], inner[1:]

    def heed(self, number: int, instruction: int, data: bytes) -> None:
        if instruction == SYNC_WRITE:
            address, size = (int.from_bytes(data[k : k + 2], "little") for k in (0, 2))
            for k in range(4, len(data), 1 + size):
                if motor := self.hearing(data[k]):
                    motor.write(address, data[k + 1 : k + 1 + size])
        elif instruction == SYNC_READ:
            address, size = (int.from_bytes(data[k : k + 2], "little") for k in (0, 2))
            for each in data[4:]:
                if motor := self.hearing(each):
                    self.answer(each, motor.alert, bytes(motor.table[address : address + size]))
        elif instruction == PING:
            for each in self.motors if number == EVERYBODY else (number,):
                if motor := self.hearing(each):
                    self.answer(each, motor.alert, b"\x24\x04\x2d")
        elif motor := self.hearing(number):
            address = int.from_bytes(data[:2], "little")
            if instruction == WRITE:
                self.answer(number, motor.alert | motor.write(address, data[2:]))
            elif instruction == READ:
                self.answer(number, motor.alert, bytes(motor.table[address : address + data[2]]))

    def hearing(self, number: int) -> EmulatedMotor | None:
        motor = self.motors.get(number)
        if motor and motor.deaf:
            motor.deaf -= 1
            return None
        return motor

    def answer(self, number: int, error: int, data: bytes = b"") -> None:
        inner = (bytes([STATUS, error]) + data).replace(b"\xff\xff\xfd", b"\xff\xff\xfd\xfd")
        packet = HEAD + bytes([number]) + (len(inner) + 2).to_bytes(2, "little") + inner
        os.write(self.wire, packet + crc(packet).to_bytes(2, "little"))


@contextmanager
def chain(motors: dict[int, EmulatedMotor]):
    """Name of the serial port of the motors."""
    wire, port = os.openpty()
    tty.setraw(port)
    thread = threading.Thread(target=Chain(motors, wire).serve, daemon=True)
    thread.start()
    try:
        yield os.ttyname(port)
    finally:
        os.close(port)
        thread.join(60)
        os.close(wire)
