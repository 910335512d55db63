"""A serial channel at a pseudo-terminal: it waits for the first byte, and takes all that is there."""

import os
import threading
import tty

import pytest

from cfem.plant.device.channel import SerialChannel

pytest.importorskip("serial")
pytestmark = pytest.mark.skipif(not hasattr(os, "openpty"), reason="needs a pty")


@pytest.fixture
def ends():
    """The board's end (a file descriptor) and the open channel."""
    board, port = os.openpty()
    tty.setraw(board), tty.setraw(port)
    channel = SerialChannel(os.ttyname(port), 115200)
    channel.open()
    yield board, channel
    channel.close()
    os.close(board), os.close(port)


def test_bytes_that_have_come_are_read_at_once_and_whole(ends):
    board, channel = ends
    os.write(board, b"frame")
    data = channel.read(5.0)
    data += channel.read(0.0) if len(data) < 5 else b""
    assert data == b"frame"


def test_bytes_that_come_later_are_waited_for(ends):
    board, channel = ends
    later = threading.Timer(0.1, os.write, (board, b"later"))
    later.start()
    assert channel.read(20.0)[:1] == b"l"
    later.join()


def test_silence_is_no_bytes(ends):
    assert ends[1].read(0.01) == b""
