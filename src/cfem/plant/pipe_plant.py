"""A plant that is another program: JSON lines on its stdin and stdout. The protocol is in docs/closed-loop.md; the
program may be in any language and drive valves, motors and a tracker."""

import json
import subprocess  # nosec B404
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from queue import Empty, Queue
from typing import Any

import numpy as np

from cfem.condensed import Rows
from cfem.core.errors import InputError
from cfem.plant.protocol import Command, Measurement

VERSION = 1
FIRST_TIMEOUT = 30.0  # s


class PipePlant:
    """Runs `command` and speaks to it; to be used in a `with`, which tells the device to let go and ends it.

    rest_e: (n_e,) mm; timeout: s that it may take to answer, but the first time; period: s from one command
    to the next, 0 for as fast as it answers; folder: where it starts; markers: names of those that it answers; late:
    commands that were sent later than the period asks. InputError where it cannot be started, ends, is silent or talks
    nonsense."""

    def __init__(
        self,
        command: Sequence[str],
        rows: Rows,
        rest_e: np.ndarray,
        timeout: float = 1.0,
        period: float = 0.0,
        folder: Path | None = None,
        markers: Sequence[str] = (),
    ):
        self._command, self._rows, self._rest_e = tuple(command), rows, rest_e
        self._timeout, self._period = timeout, period
        self._folder, self._markers = folder, tuple(markers)
        self._lines: Queue[str | None] = Queue()
        self._t, self._due, self.late = 0, 0.0, 0

    def __enter__(self) -> "PipePlant":
        try:
            # the user's own program, without a shell
            self._process = subprocess.Popen(  # nosec B603
                self._command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
                encoding="utf-8",
                errors="replace",
                cwd=self._folder,
                bufsize=1,
            )
        except OSError as error:
            raise self._wrong(f"cannot be started: {error.strerror}") from error
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()
        try:
            answer = self._ask(
                {
                    "hello": "cfem-plant",
                    "version": VERSION,
                    "effectors": self._rows.effectors,
                    "actuators": self._rows.actuators,
                    "rest_e": self._rest_e.tolist(),
                    **({"markers": self._markers} if self._markers else {}),
                },
                FIRST_TIMEOUT,
            )
            if answer.get("ready") is not True or answer.get("version") != VERSION:
                raise self._wrong(f'answered {answer} to hello, expected {{"ready": true, "version": {VERSION}}}')
        except BaseException:
            self._end()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._end()

    def step(self, u: np.ndarray, kind: Command = "displacement") -> Measurement:
        now = time.monotonic()
        if self._due > now:
            time.sleep(self._due - now)
        elif self._t and self._period:
            self.late += 1
        self._due = max(self._due, now) + self._period
        self._t += 1
        answer = self._ask({"t": self._t, "kind": kind, "u": np.asarray(u, float).tolist()}, self._timeout)
        t = answer.get("t")
        if not isinstance(t, int) or isinstance(t, bool) or not 0 <= t <= self._t:
            raise self._wrong(f"answered t = {t!r} to step {self._t}, expected the step that it measured")
        x_e = self._numbers(answer, "x_e", self._rows.n_e)
        delta_a, lambda_a = (self._numbers(answer, name, self._rows.n_a) for name in ("delta_a", "lambda_a"))
        unseen = x_e is None
        return Measurement(
            np.full(self._rows.n_e, np.nan) if unseen else x_e,
            delta_a,
            lambda_a,
            t,
            "the device does not see the effectors" if unseen and not self._markers else "converged",
            self._seen(answer) if self._markers else None,
        )

    def _seen(self, answer: dict[str, Any]) -> np.ndarray:
        """(m, 3) mm, nan for a marker that is null or left out."""
        places = answer.get("markers")
        if not isinstance(places, dict) or set(places) - set(self._markers):
            what = f"answered markers = {str(places)[:80]}, expected an object of some of {', '.join(self._markers)}"
            raise self._wrong(what)
        nothing = np.full(3, np.nan)
        found = (self._numbers(places, name, 3) for name in self._markers)
        return np.array([nothing if one is None else one for one in found])

    def _numbers(self, answer: dict[str, Any], name: str, count: int) -> np.ndarray | None:
        """(count,) or None where the device says null or nothing."""
        value = answer.get(name)
        if value is None:
            return None
        try:
            numbers = np.array(value, dtype=float)
        except (TypeError, ValueError):
            numbers = np.array(np.nan)
        if numbers.shape != (count,) or not np.isfinite(numbers).all():
            raise self._wrong(f"answered {name} = {value!r}, expected {count} finite numbers or null")
        return numbers

    def _ask(self, message: dict[str, Any], timeout: float) -> dict[str, Any]:
        early = self._next(0.0)
        if early is not None:
            raise self._wrong(f"said {early.strip()[:80]!r} without being asked")
        with suppress(OSError):  # it has closed its ears: the end of its stdout says so in a moment
            self._process.stdin.write(json.dumps(message) + "\n")
        line = self._next(timeout)
        if line is None:
            raise self._wrong(f"gave no answer within {timeout:g} s")
        try:
            answer = json.loads(line)
        except ValueError:
            answer = None
        if not isinstance(answer, dict):
            raise self._wrong(f"answered {line.strip()[:80]!r}, which is no JSON object on a line")
        if "error" in answer:
            raise self._wrong(f"reports: {answer['error']}")
        return answer

    def _next(self, timeout: float) -> str | None:
        """A line that it has said, None where it says none in time (s)."""
        try:
            line = self._lines.get(timeout=timeout) if timeout else self._lines.get_nowait()
        except Empty:
            return None
        if line is None:
            raise self._wrong(f"ended (exit code {self._process.wait()}) instead of answering")
        return line

    def _listen(self) -> None:
        for line in self._process.stdout:
            self._lines.put(line)
        self._lines.put(None)

    def _end(self) -> None:
        """Ask it to let go; one that does not listen is ended."""
        with suppress(OSError):
            self._process.stdin.write('{"bye": true}\n')
        with suppress(OSError):
            self._process.stdin.close()
        try:
            self._process.wait(timeout=2.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._listener.join(timeout=1.0)
        if not self._listener.is_alive():  # else a child of the device still holds the other end
            self._process.stdout.close()

    def _wrong(self, what: str) -> InputError:
        return InputError(
            what, where=f"device '{' '.join(self._command)}'", do="see the protocol in docs/closed-loop.md"
        )
