"""A device that is a program, which exchanges lines of JSON on its standard input and output."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cfem.plant.device.answer import Malformed, answer_of, shown
from cfem.plant.device.process import DeviceProcess

GOODBYE = '{"bye": true}'


class Lines:
    """Messages of `DevicePlant` as lines. command: the program and its arguments; folder: where it starts."""

    def __init__(self, command: Sequence[str], folder: Path | None = None):
        self._command, self._folder = tuple(command), folder
        self._process: DeviceProcess | None = None
        self.where = f"device '{' '.join(self._command)}'"

    @property
    def returncode(self) -> int | None:
        """Exit code of the device, None while it runs."""
        return self._process.returncode

    def start(self) -> None:
        """Starts the program. OSError where that fails."""
        self._process = DeviceProcess(self._command, self._folder)

    def ask(self, message: dict[str, Any], timeout: float) -> dict[str, Any]:
        """Answer to a message. Malformed where the device gives none that can be read within `timeout` seconds."""
        early = self._process.line(0.0)
        if early is not None:
            raise Malformed(f"said '{shown(early)}' without being asked")
        self._process.tell(json.dumps(message))
        line = self._process.line(timeout)
        if line is None:
            raise Malformed(f"gave no answer within {timeout:g} s")
        return answer_of(line)

    def losses(self) -> None:
        """None: a pipe loses nothing."""

    def end(self) -> None:
        """Says goodbye and ends the program."""
        self._process.end(GOODBYE)
