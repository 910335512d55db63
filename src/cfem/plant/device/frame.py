"""Frames of bytes over a serial line or UDP. `cfem_wire.h` of the C export has the same layout and receiver."""

import struct
from binascii import crc_hqx
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

from cfem.condensed import Rows

VERSION = 1
SYNC = b"\xc5\x5c"
HEAD = struct.Struct("<2sBBBBHII")  # sync, version, kind, count, 255 - count, sequence, tick, stamp
CHECKSUM = struct.Struct("<H")
CHECKED = len(SYNC)  # where the checksum begins
LENGTHS = 6  # bytes that tell a frame's length
MOST = 255  # floats


class Kind(IntEnum):
    """What a frame says; cfem_wire.h has what each holds."""

    HELLO = 1
    READY = 2
    DISPLACEMENT = 3
    FORCE = 4
    ANSWER = 5
    GOAL = 6
    COMMAND = 7
    STOPPED = 8
    FAULT = 9
    BYE = 10


@dataclass(frozen=True)
class Frame:
    """Frame of the wire protocol.

    kind: of `Kind`, or another that some device knows
    sequence, tick, stamp: taken modulo 2^16, 2^32 and 2^32; the stamp is us of the sender's clock
    payload: in single precision"""

    kind: int
    tick: int = 0
    payload: tuple[float, ...] = ()
    sequence: int = 0
    stamp: int = 0
    version: int = VERSION

    def packed(self) -> bytes:
        """Bytes of the frame."""
        count, short, long = len(self.payload), 2**16, 2**32
        numbers = self.sequence % short, self.tick % long, self.stamp % long
        head = HEAD.pack(SYNC, self.version, self.kind, count, MOST - count, *numbers)
        inner = head + struct.pack(f"<{count}f", *self.payload)
        return inner + CHECKSUM.pack(checksum(inner[CHECKED:]))


def checksum(data: bytes) -> int:
    """CRC-16/CCITT."""
    return crc_hqx(data, 0xFFFF)


def robot_checksum(rows: Rows) -> int:
    """Checksum of the names of the robot's rows, by which a device is known to be of the same robot."""
    return checksum(f"{' '.join(rows.effectors)}\n{' '.join(rows.actuators)}".encode())


class Receiver:
    """Frames in a stream of bytes, damaged ones left out. most: floats of the longest; skipped: bytes so far of no
    frame."""

    def __init__(self, most: int = MOST):
        self._bytes, self._most, self.skipped = b"", most, 0

    def feed(self, data: bytes) -> list[Frame]:
        """The frames that `data` completes."""
        self._bytes += data
        frames, start = [], 0
        while start < len(self._bytes):
            end = start + self._length(start)
            if end > len(self._bytes):
                break
            if end > start and _intact(self._bytes[start:end]):
                frames.append(_unpacked(self._bytes[start:end]))
                start = end
            else:
                start, self.skipped = start + 1, self.skipped + 1
        self._bytes = self._bytes[start:]
        return frames

    def quiet(self) -> list[Frame]:
        """Gives up a frame that has begun, as no byte has come for a while; frames within what was taken for it."""
        self.skipped += bool(self._bytes)
        self._bytes = self._bytes[1:]
        return self.feed(b"")

    def _length(self, start: int) -> int:
        """Bytes of the frame that begins at `start`, 0 where none does; the least where its length is not there yet."""
        head = self._bytes[start : start + LENGTHS]
        if not SYNC.startswith(head[: len(SYNC)]):
            return 0
        if len(head) < LENGTHS:
            return LENGTHS
        count = head[4]
        return HEAD.size + 4 * count + CHECKSUM.size if count + head[5] == MOST and count <= self._most else 0


def _intact(data: bytes) -> bool:
    return checksum(data[CHECKED : -CHECKSUM.size]) == CHECKSUM.unpack(data[-CHECKSUM.size :])[0]


def _unpacked(data: bytes) -> Frame:
    _, version, kind, count, _, sequence, tick, stamp = HEAD.unpack_from(data)
    return Frame(kind, tick, struct.unpack_from(f"<{count}f", data, HEAD.size), sequence, stamp, version)


def floats(*parts: Sequence[float]) -> tuple[float, ...]:
    """One payload of several lists."""
    return tuple(number for part in parts for number in part)
