"""Work under way: `.NAME.partial` beside an artefact NAME, and the mark that says what it is being made from.

The mark is what makes the folder cfem's own. Killed work of the same inputs goes on, also after work of other inputs
has moved it aside."""

import os
import re
import shutil
from pathlib import Path

from cfem.core.artefact.files import disk_errors, refuse_link, remove_unfinished, write_whole
from cfem.core.artefact.place import announced, free_name
from cfem.core.errors import OutputError

CHEAP = 60.0  # s of work, below which what is unfinished is deleted rather than moved aside
_DISCARDED = "discarded"


def partial_folder(out: Path) -> Path:
    """Folder in which a stage builds its output; kept after an interruption so that a resumable stage can go on."""
    return out.with_name(f".{out.name}.partial")


def begin(out: Path, made_from: str, precious: bool) -> Path:
    """The folder in which to work: with what an interrupted run of the same inputs left, else empty. What is there of
    other inputs is moved aside where it is precious and took longer than CHEAP, and deleted otherwise. OutputError
    where the folder holds files that cfem did not write."""
    partial, mark = partial_folder(out), mark_of(out)
    refuse_link(partial)
    with disk_errors(partial):
        if partial.is_dir() and read_mark(mark) == made_from:
            remove_unfinished(partial)
            return partial
        _clear(out, partial, mark, precious)
        if aside := _aside(out, made_from):
            os.replace(mark_of(aside), mark)
            os.replace(aside, partial)
            remove_unfinished(partial)
        else:
            partial.mkdir(parents=True)
            write_whole(mark, made_from.encode())
    return partial


def finish(out: Path) -> None:
    """Removes the mark; to be called when the folder has taken the artefact's place."""
    with disk_errors(mark_of(out)):
        mark_of(out).unlink(missing_ok=True)


def _clear(out: Path, partial: Path, mark: Path, precious: bool) -> None:
    """Clears the place `partial`."""
    if partial.is_dir() and any(partial.iterdir()):
        if not read_mark(mark):
            what = "holds files that cfem did not make, at the place where it works"
            raise OutputError(what, where=os.path.normpath(partial), do="move them, or choose another --out")
        if precious and read_mark(mark) != _DISCARDED and _seconds(partial, mark) > CHEAP:
            aside = free_name(out.with_name(f"{out.name}.partial"))
            announced(partial, aside, "it was made from other inputs, and cost much; of the same inputs it goes on")
            os.replace(partial, aside)
            os.replace(mark, mark_of(aside))
    if partial.is_dir():
        write_whole(mark, _DISCARDED.encode())  # first: what it marked is whole no more, and still cfem's own
        shutil.rmtree(partial, ignore_errors=True)


def _aside(out: Path, made_from: str) -> Path | None:
    """Unfinished work of these inputs that was moved aside."""
    pattern = re.compile(rf"{re.escape(out.name)}\.partial\.old-[0-9]+")
    siblings = sorted(out.parent.iterdir()) if out.parent.is_dir() else []
    folders = (path for path in siblings if pattern.fullmatch(path.name) and path.is_dir())
    return next((path for path in folders if read_mark(mark_of(path)) == made_from), None)


def mark_of(out: Path) -> Path:
    """The file that says what the unfinished work of `out` is being made from."""
    return out.with_name(f".{out.name}.made_from")


def read_mark(mark: Path) -> str:
    """Text of a mark, empty where there is none of cfem's."""
    if mark.is_symlink() or not mark.is_file():
        return ""
    text = mark.read_text(encoding="utf-8", errors="replace")
    return text if text == _DISCARDED or re.fullmatch(r"[0-9a-f]{64}", text) else ""


def _seconds(partial: Path, mark: Path) -> float:
    """Duration (s) of the work, from its beginning to the last file that it wrote."""
    times = [path.stat().st_mtime for path in (mark, *partial.rglob("*")) if path.is_file()]
    return max(times) - min(times)
