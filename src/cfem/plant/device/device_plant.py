"""A plant that is a device: a program, or a board at the other end of a wire. The protocol is in docs/closed-loop.md;
the device may be in any language and drive valves, motors and a tracker."""

import time
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from cfem.condensed import Rows
from cfem.condensed.far import far_of, in_metres
from cfem.core.errors import InputError
from cfem.plant.device.answer import FAR, Malformed, numbers, shown, step_of
from cfem.plant.protocol import Command, Measurement

VERSION = 1
FIRST_TIMEOUT = 30.0  # s


class Transport(Protocol):
    """What carries messages to a device and back. where: its name in messages."""

    where: str

    def start(self) -> None:
        """OSError where there is no device."""
        ...

    def ask(self, message: dict[str, Any], timeout: float) -> dict[str, Any] | None:
        """Answer to a message; None where it was lost, which a program's never is. Malformed where the device is silent
        for longer than `timeout` seconds or says what is no answer."""
        ...

    def losses(self) -> dict[str, int] | None:
        """Losses on the way; None where nothing can be."""
        ...

    def end(self) -> None:
        """Says goodbye. Called once the device was started, whatever came of it."""
        ...


class DevicePlant:
    """Speaks to a device; to be used in a `with`, which tells the device to let go and ends it.

    late: number of commands that were sent later than the period asks. InputError where the device cannot be started,
    ends, is silent, or answers otherwise than the protocol has it. A step whose answer was lost repeats the last
    measurement, which keeps its number."""

    def __init__(
        self,
        transport: Transport,
        rows: Rows,
        rest_e: np.ndarray,
        timeout: float = 1.0,
        period: float = 0.0,
        markers: Sequence[str] = (),
        length: float = np.inf,
        reach: np.ndarray | None = None,
    ):
        """Names the device and what its answers must fit.

        transport: what carries messages to it
        rows, rest_e: of the robot, (n_e,) mm
        timeout: s that the device may take to answer; the first time it has FIRST_TIMEOUT
        period: s from one command to the next, 0 for as fast as it answers
        markers: names that answers may have
        length, reach: mm, and (n_a, 2) mm or mm^3: a position farther from rest than FAR times these is none"""
        self.transport, self._rows, self._rest_e = transport, rows, rest_e
        self._timeout, self._period, self._markers = timeout, period, tuple(markers)
        self._length = FAR * length
        self._farthest_e = np.where(rows.turns, FAR * 2 * np.pi, self._length)
        self._far = far_of(rows, length)
        self._farthest_a = np.inf if reach is None else FAR * np.abs(reach).max(axis=1)
        self._last = Measurement(np.full(rows.n_e, np.nan), None, None, 0, "")
        self._t, self._due, self.late = 0, 0.0, 0

    def __enter__(self) -> "DevicePlant":
        """Starts the device and says hello. InputError where it cannot be started or answers otherwise than the
        protocol has it."""
        try:
            self.transport.start()
        except OSError as error:
            raise self._wrong(f"cannot be started: {error.strerror or error}") from error
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
            version = answer.get("version")
            if answer.get("ready") is not True or type(version) is not int or version != VERSION:
                expected = f'{{"ready": true, "version": {VERSION}}}'
                raise self._wrong(f"answered {shown(answer)} to hello, expected {expected}")
        except BaseException:
            self.transport.end()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.transport.end()

    @property
    def losses(self) -> dict[str, int] | None:
        """Losses on the way so far; None where nothing can be."""
        return self.transport.losses()

    def step(self, u: np.ndarray, kind: Command = "displacement") -> Measurement:
        """Measurement after a command, sent at the next tick of the clock."""
        now = time.monotonic()
        if self._due > now:
            time.sleep(self._due - now)
        elif self._t and self._period:
            self.late += 1
        self._due = max(self._due, now) + self._period
        self._t += 1
        answer = self._ask({"t": self._t, "kind": kind, "u": np.asarray(u, float).tolist()}, self._timeout)
        try:
            self._last = self._last if answer is None else self._measured(answer)
        except Malformed as why:
            raise self._wrong(str(why)) from why
        return self._last

    def _measured(self, answer: dict[str, Any]) -> Measurement:
        """Measurement of an answer. Malformed where the answer is none."""
        t = step_of(answer, self._t, self._last.t)
        x_e = numbers(answer, "x_e", self._rest_e, self._farthest_e)
        none = np.zeros(self._rows.n_a)
        delta_a, lambda_a = numbers(answer, "delta_a", none, self._farthest_a), numbers(answer, "lambda_a", none)
        unseen = x_e is None
        if not unseen and in_metres(x_e, self._rest_e, self._far):
            raise Malformed(f"answered x_e = {shown(answer['x_e'])}, which is in metres: x_e is in mm")
        measurement = Measurement(
            np.full(self._rows.n_e, np.nan) if unseen else x_e,
            delta_a,
            lambda_a,
            t,
            "the device does not see the effectors" if unseen and not self._markers else "converged",
            self._seen(answer) if self._markers else None,
        )
        if t and t == self._last.t and not _same_sample(measurement, self._last):
            raise Malformed(
                f"answered another sample for t = {t}, which it has used before: each sample has its own step"
            )
        return measurement

    def _seen(self, answer: dict[str, Any]) -> np.ndarray:
        """Markers (m, 3) mm of an answer, nan for one that is null or left out."""
        places = answer.get("markers")
        if not isinstance(places, dict) or set(places) - set(self._markers):
            raise Malformed(
                f"answered markers = {shown(places)}, expected an object of some of {', '.join(self._markers)}"
            )
        nothing, rest = np.full(3, np.nan), self._rest_e[:3] if len(self._rest_e) >= 3 else np.zeros(3)
        positions = (numbers(places, name, rest, self._length) for name in self._markers)
        return np.array([nothing if position is None else position for position in positions])

    def _ask(self, message: dict[str, Any], timeout: float) -> dict[str, Any] | None:
        """Answer to a message. InputError of `_wrong` where the device gives none that can be read."""
        try:
            return self.transport.ask(message, timeout)
        except Malformed as why:
            raise self._wrong(str(why)) from why

    def _wrong(self, what: str) -> InputError:
        return InputError(what, where=self.transport.where, do="see the protocol in docs/closed-loop.md")


def _same_sample(measurement: Measurement, last: Measurement) -> bool:
    """True if both samples have the same numbers, as far as both have any."""
    pairs = [(measurement.x_e, last.x_e)] + (
        [] if measurement.markers is None else [(measurement.markers, last.markers)]
    )
    return all(
        ((values == last_values) | np.isnan(values) | np.isnan(last_values)).all()
        for values, last_values in pairs
        if last_values is not None
    )
