"""The example of firmware at a wire, compiled here, behind a pseudo-terminal or a socket."""

import os
import re
import socket
import subprocess
import threading
import tty
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from export.embedded import export, spectral, tool

from cfem.export.compiled import build
from cfem.export.firmware.copying import library_files
from cfem.plant.device.channel import SerialChannel, UdpChannel

STRICT = ("-O1", "-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wshadow", "-Werror")
# A clock that goes on by a millisecond whenever a wait for bytes is in vain: silence has an exact length.
CLOCK = r"""
#define _POSIX_C_SOURCE 200112L
#include <poll.h>
#include <time.h>
static long long now;
int quiet_poll(struct pollfd *wires, nfds_t count, int timeout) {
    const int found = poll(wires, count, timeout);
    if (!found) now += 1000000;
    return found;
}
int quiet_clock(clockid_t clock, struct timespec *t) {
    (void)clock;
    t->tv_sec = (time_t)(now / 1000000000), t->tv_nsec = (long)(now % 1000000000);
    return 0;
}
"""


def firmware(folder: Path, model: tuple[dict, dict] | None = None, own_clock: bool = False, **spec) -> Path:
    """The program. own_clock: time passes for it only while it waits in vain."""
    export(folder, model or spectral(), vectors=3, wire=True, **spec)
    redefined = ("-Dpoll=quiet_poll", "-Dclock_gettime=quiet_clock") if own_clock else ()
    sources = [*library_files(folder), "wire.c"]
    objects = build.objects([tool("gcc"), *STRICT, "-fsanitize=undefined", *redefined], folder, sources, folder)
    if own_clock:
        (folder / "clock.c").write_text(CLOCK)
        objects += build.objects([tool("gcc"), *STRICT], folder, ["clock.c"], folder)
    build.run([tool("gcc"), "-fsanitize=undefined", "-o", "wire", *map(str, objects), "-lm"], folder)
    return folder / "wire"


@contextmanager
def on_a_serial_port(program: Path):
    """A channel to the program, whose standard input and output are a pseudo-terminal."""
    board, port = os.openpty()
    tty.setraw(port)
    running = subprocess.Popen([program], stdin=board, stdout=board)
    os.close(board)
    try:
        yield SerialChannel(os.ttyname(port), 115200)
    finally:
        os.close(port)  # the program's input ends
        assert running.wait(60) == 0


@contextmanager
def on_an_emulated_board(folder: Path, cpu: str = "m7"):
    """A channel to the folder's firmware on an emulated Cortex-M, whose UART is a pseudo-terminal."""
    qemu, board = tool("qemu-system-arm"), {"m4": "mps2-an386", "m7": "mps2-an500"}[cpu]
    tool("arm-none-eabi-gcc")
    build.run([tool("make"), "-s", "-C", str(folder), f"wire-{cpu}.elf", f"CPU={cpu}"], folder)
    words = [qemu, "-M", board, "-nographic", "-monitor", "none", "-serial", "pty", "-kernel", f"wire-{cpu}.elf"]
    words += ["-semihosting-config", "enable=on,target=native"]
    running = subprocess.Popen(words, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        said = ""
        while not (place := re.search(r"redirected to (\S+)", said)):
            line = running.stdout.readline()
            assert line, said
            said += line
        yield SerialChannel(place[1], 115200)
    finally:
        running.kill()
        running.wait(60)
        running.stdout.close()


@contextmanager
def on_udp(program: Path):
    """A channel to the program, whose standard input and output are a socket that answers who speaks first."""
    board = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    board.bind(("127.0.0.1", 0))
    started = []

    def serve() -> None:
        _, peer = board.recvfrom(1, socket.MSG_PEEK)
        board.connect(peer)
        started.append(subprocess.Popen([program], stdin=board, stdout=board))

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield UdpChannel(*board.getsockname())
    finally:
        thread.join(60)
        for running in started:
            running.kill()
            running.wait(60)
        board.close()


class BadWire:
    """A channel that flips, loses, doubles or holds back a share of the bytes, each kind alike, both ways."""

    def __init__(self, channel, share: float, seed: int):
        self.channel, self.share, self.where = channel, share, channel.where
        self.rng, self.held, self.close = np.random.default_rng(seed), b"", channel.close

    def open(self) -> None:
        self.channel.open()

    def spoilt(self, data: bytes) -> bytes:
        out = bytearray()
        for byte in data:
            fault = self.rng.integers(4) if self.rng.random() < self.share else None
            if fault == 0:
                out.append(byte ^ 1 << self.rng.integers(8))
            elif fault == 2:
                out += bytes([byte, byte])
            elif fault == 3:
                late, self.held = self.held, bytes([byte])
                out += late
            elif fault is None:
                out.append(byte)
        return bytes(out)

    def write(self, data: bytes) -> None:
        self.channel.write(self.spoilt(data))

    def read(self, timeout: float) -> bytes:
        return self.spoilt(self.channel.read(timeout))
