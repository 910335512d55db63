"""The page in which the reader moves the robot (`cfem export`, format html): a file beside the report, which links it.
The report itself stays one file that is sent and printed as it is."""

from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import Any

from cfem.core.artefact.content import artefact_file
from cfem.core.console.shown import size
from cfem.core.errors import InputError

EXPORTED, MOVED = "page.html", "robot.html"


def page_of(folder: Path, manifest: Mapping[str, Any]) -> bytes:
    """The file. InputError where the folder has none."""
    if manifest["stage"] != "export" or EXPORTED not in manifest["files"]:
        raise InputError("has no page of the robot", where=str(folder), do="export with formats: [html]")
    return artefact_file(folder, EXPORTED).read_bytes()


def link(folder: Path, manifest: Mapping[str, Any]) -> str:
    """Link to the page on which the robot is moved, as HTML."""
    large = escape(size(len(page_of(folder, manifest))))
    return (
        f'<p class="open"><a href="{MOVED}">Move the robot</a> <small>Drag its tip, pull its actuators. This opens '
        f"{MOVED}, the file beside this one ({large}): send both together.</small></p>"
    )
