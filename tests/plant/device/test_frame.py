"""Frames over a wire: their bytes, and the way back to them after noise."""

import struct

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from support.noise import FAULTS, damaged, frames, pieces

from cfem.condensed import Rows
from cfem.plant.device.frame import Frame, Kind, Receiver, checksum, robot_checksum

MOST = 8
FRAMES = st.lists(frames(MOST), max_size=5)
CUTS = st.lists(st.integers(0, 2**20), max_size=6)


def bits_of(data: bytes) -> list[int]:
    return [byte >> bit & 1 for byte in data for bit in range(7, -1, -1)]


def remainder(data: bytes) -> int:
    """CRC-16/CCITT by its definition: bits, the first 16 inverted, times x^16, divided by x^16 + x^12 + x^5 + 1."""
    bits = np.array(bits_of(data) + [0] * 16)
    bits[:16] ^= 1
    divisor = np.zeros(17, int)
    divisor[[0, 4, 11, 16]] = 1
    for k in range(len(bits) - 16):
        if bits[k]:
            bits[k : k + 17] ^= divisor
    return int("".join(map(str, bits[-16:])), 2)


def test_the_checksum_is_that_of_the_catalogue():
    """0x29b1 is the check value of CRC-16/IBM-3740, also called CCITT-FALSE, in the catalogue of parametrised CRCs."""
    assert checksum(b"123456789") == 0x29B1


@given(st.binary(min_size=2, max_size=40))
def test_the_checksum_is_the_remainder_of_a_division(data):
    assert checksum(data) == remainder(data)


def test_the_bytes_are_those_of_the_table():
    data = Frame(Kind.FORCE, 0x01020304, (1.0, -2.5), 0x0A0B, 0x11121314).packed()
    assert data[:16].hex(" ") == "c5 5c 01 04 02 fd 0b 0a 04 03 02 01 14 13 12 11"
    assert data[16:24] == struct.pack("<ff", 1.0, -2.5) and len(data) == 26
    assert int.from_bytes(data[24:], "little") == remainder(data[2:24])


def test_the_robot_is_known_by_the_names_of_its_rows():
    rows = Rows(("tip.x", "tip.y"), ("left", "right"))
    assert robot_checksum(rows) == remainder(b"tip.x tip.y\nleft right")
    assert robot_checksum(rows) != robot_checksum(Rows(("tip.x", "tip.y"), ("right", "left")))


@given(sent=FRAMES, cuts=CUTS)
def test_what_is_sent_comes_back_however_it_is_cut(sent, cuts):
    receiver = Receiver(MOST)
    came = [frame for part in pieces(b"".join(frame.packed() for frame in sent), cuts) for frame in receiver.feed(part)]
    assert came == sent and receiver.skipped == 0


@given(sent=FRAMES, noise=st.lists(st.binary(max_size=30), min_size=6, max_size=6))
def test_every_whole_frame_is_found_in_noise(sent, noise):
    """Noise that looks like the beginning of a frame is given up when nothing more comes."""
    stream = noise[0] + b"".join(frame.packed() + after for frame, after in zip(sent, noise[1:], strict=False))
    receiver = Receiver(MOST)
    came = receiver.feed(stream)
    for _ in stream:
        came += receiver.quiet()
    assert came == sent
    assert receiver.skipped == len(stream) - sum(len(frame.packed()) for frame in sent)


@given(sent=FRAMES, faults=st.lists(FAULTS, max_size=3), cuts=CUTS)
def test_a_damaged_frame_costs_itself_alone(sent, faults, cuts):
    """What a receiver finds depends on the bytes alone, not on how they are cut. A checksum tells up to three changed
    bits, and all but one in 65536 of other changes."""
    stream = damaged(b"".join(frame.packed() for frame in sent), faults)
    receiver, other = Receiver(MOST), Receiver(MOST)
    came = [frame for part in pieces(stream, cuts) for frame in receiver.feed(part)]
    assert came == other.feed(stream)
    for _ in stream:
        came += receiver.quiet()
    assert len(came) >= len(sent) - len(faults) and all(frame in sent for frame in came)


def test_a_length_beyond_the_longest_is_none():
    receiver = Receiver(2)
    assert receiver.feed(Frame(1, 0, (1.0, 2.0, 3.0)).packed()) == [] and receiver.skipped == 18 + 12
    assert len(receiver.feed(Frame(1, 0, (1.0, 2.0)).packed())) == 1


def test_names_of_rows_have_the_checksum_that_the_documentation_states():
    names = b"tip.x tip.y tip.z\nleft right"
    assert remainder(names) == robot_checksum(Rows(("tip.x", "tip.y", "tip.z"), ("left", "right"))) == 0xE68C
