"""Frames in C: byte by byte those of Python, from the same streams, however damaged."""

import ctypes

import numpy as np
import pytest
from export.embedded import export, needs_compiler, spectral
from hypothesis import given
from hypothesis import strategies as st
from support.noise import FAULTS, damaged, frames

from cfem.condensed import Rows
from cfem.export.compiled.build import library
from cfem.export.compiled.structures import structures
from cfem.plant.device.frame import Frame, Kind, Receiver, checksum, robot_checksum

pytestmark = needs_compiler
MOST = 2 * (3 + 2) + 2  # of the synthetic robot: cfem_wire.h


class CWire:
    """The codec of a C folder. most: floats of the longest frame."""

    def __init__(self, folder):
        types = structures(folder, "cfem_wire.h")
        self.frame, self.receiver = types["cfem_wire_frame"], types["cfem_wire_receiver"]()
        self.library = library(folder, ("-O1", "-fsanitize=undefined", "-fno-sanitize-recover=all"))
        for name in ("checksum", "robot"):
            getattr(self.library, f"cfem_wire_{name}").restype = ctypes.c_uint16
        self.most = self.frame().payload._length_
        self.reset()

    def reset(self) -> None:
        self.library.cfem_wire_init(ctypes.byref(self.receiver))

    def packed(self, frame: Frame) -> bytes:
        made = self.frame(version=frame.version, kind=frame.kind, count=len(frame.payload), sequence=frame.sequence)
        made.tick, made.stamp = frame.tick, frame.stamp
        made.payload[: len(frame.payload)] = frame.payload
        data = (ctypes.c_uint8 * (18 + 4 * self.most))()
        return bytes(data[: self.library.cfem_wire_pack(ctypes.byref(made), data)])

    def _frames(self) -> list[Frame]:
        found, one = [], self.frame()
        while self.library.cfem_wire_next(ctypes.byref(self.receiver), ctypes.byref(one)):
            payload = tuple(one.payload[: one.count])
            found.append(Frame(one.kind, one.tick, payload, one.sequence, one.stamp, one.version))
        return found

    def feed(self, data: bytes) -> list[Frame]:
        found = []
        for byte in data:
            self.library.cfem_wire_put(ctypes.byref(self.receiver), byte)
            found += self._frames()
        return found

    def quiet(self) -> list[Frame]:
        self.library.cfem_wire_quiet(ctypes.byref(self.receiver))
        return self._frames()


@pytest.fixture(scope="module")
def wire(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wire")
    export(folder, spectral(), vectors=3, wire=True)
    return CWire(folder)


def test_room_is_for_the_robot(wire):
    assert wire.most == MOST


@given(frame=frames(MOST))
def test_c_packs_the_bytes_of_python(wire, frame):
    assert wire.packed(frame) == frame.packed()


@given(data=st.binary(max_size=64))
def test_checksums_are_the_same(wire, data):
    assert wire.library.cfem_wire_checksum((ctypes.c_uint8 * len(data))(*data), len(data)) == checksum(data)


def test_the_robot_is_known_by_the_same_number(wire):
    rows = spectral()[0]["rows"]
    assert wire.library.cfem_wire_robot() == robot_checksum(Rows(tuple(rows["effectors"]), tuple(rows["actuators"])))


@given(sent=st.lists(frames(MOST), max_size=5), faults=st.lists(FAULTS, max_size=12), noise=st.binary(max_size=40))
def test_both_find_the_same_frames_in_damaged_streams(wire, sent, faults, noise):
    stream = noise + damaged(b"".join(frame.packed() for frame in sent), faults)
    wire.reset()
    python = Receiver(MOST)
    assert repr(wire.feed(stream)) == repr(python.feed(stream))  # NaN and -0.0 too
    assert wire.receiver.skipped == python.skipped
    for _ in range(len(stream)):
        assert repr(wire.quiet()) == repr(python.quiet())
    assert wire.receiver.skipped == python.skipped and wire.receiver.filled == 0


def test_nan_is_the_payload_of_what_nothing_measures(wire):
    frame = Frame(Kind.ANSWER, 5, (np.nan, 1.0))
    wire.reset()
    (found,) = wire.feed(frame.packed())
    assert np.isnan(found.payload[0]) and found.payload[1] == 1.0 and wire.packed(frame) == frame.packed()
