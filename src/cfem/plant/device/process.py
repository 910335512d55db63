"""A program that exchanges lines with us, each wait within a time: what it does or leaves undone never holds us up."""

import os
import signal
import subprocess  # nosec B404
import sys
import threading
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from queue import Empty, Full, Queue

from cfem.plant.device.answer import LONGEST, Malformed

LET_GO, LET_END = 5.0, 1.0  # s from the last line to SIGTERM, and from there to SIGKILL
UNREAD = 16  # lines that wait to be read; what comes beyond is dropped, as one too many is a fault
CLOSED, TOO_LONG = None, Malformed(f"said a line of more than {LONGEST} bytes")


class DeviceProcess:
    """A program that is the device. command: program and arguments, without a shell; folder: where it starts. It has a
    session of its own, so that Ctrl-C ends us and we end it. OSError where it cannot be started."""

    def __init__(self, command: Sequence[str], folder: Path | None = None):
        """Starts the device's program in `folder`, with threads that read its lines and write ours."""
        # the user's own program
        self._process = subprocess.Popen(  # nosec B603
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=folder, bufsize=0, start_new_session=True
        )
        self._said: Queue[str | Malformed | None] = Queue(UNREAD)
        self._told: Queue[str | None] = Queue()
        self._threads = [threading.Thread(target=work, daemon=True) for work in (self._listen, self._tell)]
        for thread in self._threads:
            thread.start()

    @property
    def returncode(self) -> int | None:
        """Exit code, None while the program runs."""
        return self._process.returncode

    def tell(self, line: str) -> None:
        """Sends a line as soon as it is read."""
        self._told.put(line)

    def line(self, timeout: float) -> str | None:
        """Next line from the device, or None after `timeout` seconds. Malformed where a line is too long or nothing
        comes any more."""
        try:
            line = self._said.get(timeout=timeout) if timeout else self._said.get_nowait()
        except Empty:
            return None
        if line is CLOSED:
            with suppress(subprocess.TimeoutExpired):
                raise Malformed(f"ended (exit code {self._process.wait(LET_END)}) instead of answering")
            raise Malformed("closed its output and lives on instead of answering")
        if isinstance(line, Malformed):
            raise line
        return line

    def end(self, last: str) -> None:
        """Sends a last line and closes the device. One that has not ended soon after gets SIGTERM, then SIGKILL, its
        children too."""
        self.tell(last)
        self._told.put(CLOSED)
        try:
            self._process.wait(LET_GO)
        except BaseException as cause:  # too slow for us, or for who interrupts again
            self._kill(getattr(signal, "SIGTERM", None))
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(LET_END)
            if self._process.returncode is None:
                self._kill(getattr(signal, "SIGKILL", None))
                with suppress(subprocess.TimeoutExpired):
                    self._process.wait(LET_END)
            if not isinstance(cause, subprocess.TimeoutExpired):
                raise
        for thread in self._threads:
            thread.join(timeout=LET_END)
        if not self._threads[0].is_alive():  # else a child of the device still holds the other end
            self._process.stdout.close()

    def _kill(self, number: int | None) -> None:
        with suppress(OSError):
            if sys.platform == "win32":
                self._process.kill()
            else:
                os.killpg(self._process.pid, number)

    def _listen(self) -> None:
        """Puts lines of the device into the queue until it closes its output."""
        line = b""
        while block := self._process.stdout.read(2**16):
            *lines, rest = (line[: LONGEST + 1] + block).split(b"\n")
            for complete in lines:
                self._heard(complete)
            line = rest
            if len(line) > LONGEST:
                self._heard(line)
        if line:
            self._heard(line)
        with suppress(Full):
            self._said.put_nowait(CLOSED)

    def _heard(self, line: bytes) -> None:
        with suppress(Full):
            text = TOO_LONG if len(line) > LONGEST else line.decode("utf-8", "replace")
            self._said.put_nowait(text)

    def _tell(self) -> None:
        with suppress(OSError):  # it has closed its ears: the end of its answers says so
            while (line := self._told.get()) is not CLOSED:
                unwritten = memoryview(line.encode() + b"\n")
                while unwritten:
                    unwritten = unwritten[self._process.stdin.write(unwritten) :]
        with suppress(OSError):
            self._process.stdin.close()
