"""A device over a channel that loses, doubles and flips bytes: messages as frames. A message without an answer is sent
again within its tick; the next tick replaces it."""

import math
import time
from collections.abc import Sequence
from typing import Any

from cfem.condensed import Rows
from cfem.plant.device.answer import Malformed
from cfem.plant.device.channel import Channel
from cfem.plant.device.frame import VERSION, Frame, Kind, Receiver, floats, robot_checksum

AGAIN = 0.5  # s from one hello to the next, until the device is ready: a board that starts up hears none
SHARE = 0.25  # of the time that a device may be silent: a wait for an answer where ticks have no period
TRIES = 3  # of a message in its tick; the device acts on the first that arrives, and repeats its answer to others
BYES = 3  # goodbyes, as one may be lost
TAKES = {Kind.DISPLACEMENT: 1, Kind.FORCE: 2, Kind.GOAL: 4}  # flags of what a device takes
KINDS = {"displacement": Kind.DISPLACEMENT, "force": Kind.FORCE}
WORDS = {Kind.DISPLACEMENT: "displacements", Kind.FORCE: "forces", Kind.GOAL: "goals"}


class Wire:
    """Messages of `DevicePlant` over a channel. rows: of the robot; period: s of a tick, 0 for as fast as the device
    answers.
    """

    def __init__(self, channel: Channel, rows: Rows, period: float = 0.0):
        self._channel, self._rows, self._period = channel, rows, period
        self._receiver, self._markers = Receiver(), ()
        self._takes, self._sent, self._t = 0, 0, 0
        self._sequence: int | None = None  # of the last frame that came
        self._heard = self._byte = 0.0  # times of the last answer, and of the last byte
        self._missed = self._stops = 0
        self.where = channel.where

    def losses(self) -> dict[str, int]:
        """missed: commands without an answer in their tick; stops: how often the device said that its watchdog has
        stopped it; skipped: bytes that belonged to no frame."""
        return {"missed": self._missed, "stops": self._stops, "skipped": self._receiver.skipped}

    def start(self) -> None:
        """OSError where the channel cannot be opened."""
        self._channel.open()

    def ask(self, message: dict[str, Any], timeout: float) -> dict[str, Any] | None:
        """Answer of the device to a message: hello, a command, or {"goal": (n_e,), "x_e": (n_e,) or None, "t": the
        number of the command that x_e followed}. None where no answer came in this tick. Malformed where the device
        is silent for longer than `timeout`, reports a fault, or takes no such message."""
        try:
            return self._greeted(message, timeout) if "hello" in message else self._answered(message, timeout)
        except OSError as error:
            raise Malformed(f"is gone: {error.strerror or error}") from error

    def end(self) -> None:
        """Says goodbye and closes the channel."""
        try:
            for _ in range(BYES):
                self._channel.write(self._packed(Kind.BYE))
        except OSError:
            pass  # it is gone already
        self._channel.close()

    def _greeted(self, message: dict[str, Any], timeout: float) -> dict[str, Any]:
        """Answer of the device to hello, which is repeated until then. Malformed after `timeout` s without one."""
        self._markers = tuple(message.get("markers", ()))
        end = time.monotonic() + timeout
        while (now := time.monotonic()) < end:
            period = self._period or timeout * SHARE
            self._channel.write(self._packed(Kind.HELLO, 0, floats([period], message["rest_e"])))
            again = min(now + AGAIN, end)
            while (left := again - time.monotonic()) > 0:
                for frame in self._frames(left):
                    if frame.kind == Kind.READY:
                        self._demand_robot(frame)
                        self._heard = time.monotonic()
                        return {"ready": True, "version": frame.version}
        raise Malformed(f"gave no answer within {timeout:g} s")

    def _demand_robot(self, ready: Frame) -> None:
        """Malformed where the device that is ready has other rows."""
        if ready.version != VERSION or len(ready.payload) != 4:
            what = (
                f"speaks version {ready.version} of the wire, with {len(ready.payload)} numbers in its answer to hello"
            )
            raise Malformed(f"{what}; expected version {VERSION} and 4 numbers")
        *sizes, takes = (int(number) if math.isfinite(number) else -1 for number in ready.payload)
        expected = [self._rows.n_e, self._rows.n_a, len(self._markers)]
        if sizes != expected:
            names = "effector rows, actuators and markers"
            raise Malformed(f"has {sizes} {names}, and the robot {expected}")
        checksum = robot_checksum(self._rows)
        if ready.tick != checksum:
            what = "is of a robot whose effectors and actuators have other names"
            raise Malformed(f"{what}, with checksum {ready.tick:x} for {checksum:x}: export its code again")
        self._takes = takes

    def _answered(self, message: dict[str, Any], timeout: float) -> dict[str, Any] | None:
        """Answer of the device to a goal or a command, sent up to TRIES times within its period; None where it is lost.
        Malformed where nothing was heard for `timeout` s."""
        kind = Kind.GOAL if "goal" in message else KINDS[message["kind"]]
        if not self._takes & TAKES[kind]:
            able = [WORDS[taken] for taken, flag in TAKES.items() if self._takes & flag]
            raise Malformed(f"takes {' and '.join(able) or 'nothing'}, and is told {WORDS[kind]}")
        if kind == Kind.GOAL:
            unseen = [math.nan] * self._rows.n_e
            payload = floats(message["goal"], unseen if message["x_e"] is None else message["x_e"])
        else:
            payload = floats(message["u"])
            self._t = message["t"]
        late = self._newest(self._frames(0.0))
        data, answer = self._packed(kind, message["t"], payload), None
        share = (self._period or timeout * SHARE) / TRIES
        end = time.monotonic()
        for _ in range(TRIES):
            if answer is None:
                self._channel.write(data)
            end += share
            while answer is None and (left := end - time.monotonic()) > 0:
                answer = self._newest(self._frames(left))
        answer = answer or late
        if answer is not None:
            self._heard = time.monotonic()
        elif time.monotonic() - self._heard > timeout:
            raise Malformed(f"gave no answer within {timeout:g} s")
        else:
            self._missed += 1
        return answer

    def _newest(self, frames: Sequence[Frame]) -> dict[str, Any] | None:
        """The last answer among frames, None where none is. Malformed where one reports a fault."""
        n_e, n_a, answer = self._rows.n_e, self._rows.n_a, None
        sizes = {Kind.ANSWER: n_e + 2 * n_a + 3 * len(self._markers), Kind.COMMAND: 2 * n_a + 1}
        for frame in frames:
            twice = frame.sequence == self._sequence
            self._sequence = frame.sequence
            if frame.kind == Kind.FAULT:
                raise Malformed(f"reports fault {frame.tick}")
            self._stops += frame.kind == Kind.STOPPED and not twice
            if twice or frame.version != VERSION or len(frame.payload) != sizes.get(frame.kind):
                continue
            if frame.kind == Kind.COMMAND:
                parts = {"delta_a": frame.payload[:n_a], "lambda_a": frame.payload[n_a:-1]}
                answer = {"t": frame.tick, **parts, "status": int(frame.payload[-1])}
            elif frame.tick <= self._t and (answer is None or frame.tick >= answer["t"]):
                answer = self._measured(frame)
        return answer

    def _measured(self, frame: Frame) -> dict[str, Any]:
        """Answer in the form that a line has."""
        n_e, n_a = self._rows.n_e, self._rows.n_a
        e, a, force = frame.payload[:n_e], frame.payload[n_e : n_e + n_a], frame.payload[n_e + n_a : n_e + 2 * n_a]
        answer = {"t": frame.tick, "x_e": _known(e), "delta_a": _known(a), "lambda_a": _known(force)}
        if self._markers:
            rest = frame.payload[n_e + 2 * n_a :]
            places = (rest[3 * k : 3 * k + 3] for k in range(len(self._markers)))
            answer["markers"] = dict(zip(self._markers, map(_known, places), strict=True))
        return answer

    def _packed(self, kind: Kind, tick: int = 0, payload: tuple[float, ...] = ()) -> bytes:
        """Bytes of the next frame."""
        self._sent += 1
        return Frame(kind, tick, payload, self._sent, int(time.monotonic() * 1e6)).packed()

    def _frames(self, timeout: float) -> list[Frame]:
        """Frames that have come, or come first within `timeout` seconds."""
        data, now = self._channel.read(timeout), time.monotonic()
        if data:
            self._byte = now
            return self._receiver.feed(data)
        return self._receiver.quiet() if now - self._byte > (self._period or SHARE) else []


def _known(numbers: Sequence[float]) -> list[float] | None:
    """None where all are NaN, as JSON has null."""
    return None if all(map(math.isnan, numbers)) else list(numbers)
