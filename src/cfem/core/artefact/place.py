"""Where an artefact goes, and what becomes of what stands there. cfem deletes nothing but its own cheap results."""

import glob
import json
import os
from pathlib import Path
from typing import Any

from cfem.core.artefact.files import disk_errors, write_whole
from cfem.core.artefact.manifest import CHANGED, MANIFEST, harm, read_manifest
from cfem.core.console.progress import say
from cfem.core.console.shown import size
from cfem.core.console.terminal import printable
from cfem.core.errors import InputError, OutputError


def destination(out: Path) -> Path:
    """The folder that `out` means: links are followed, so that a link to another disk stays a link. OutputError where
    it is a file, or the folder that the command runs in, which cannot be replaced under its feet."""
    real = Path(os.path.realpath(out))
    if real.exists() and not real.is_dir():
        raise OutputError("is a file, not a folder", where=str(out), do="choose another --out")
    if Path.cwd().is_relative_to(real):
        raise OutputError("is the folder that you are in, or above it", where=str(out), do="choose another --out")
    return real if out.is_symlink() or not out.name or out.name == ".." else out


def demand_replaceable(out: Path, stage: str, made_from: str, precious: bool, force: bool) -> None:
    """Raises OutputError where what stands at `out` is not a result of the same stage, or is precious, from other
    inputs and not `force`; InputError where its manifest is damaged and not `force`."""
    where = os.path.normpath(out)
    if not out.is_dir() or not any(out.iterdir()):
        return
    if is_foreign(out):
        raise OutputError("exists and was not made by cfem", where=where, do="choose another --out")
    try:
        old = read_manifest(out)
    except InputError:
        if not force:
            raise
        return
    if old.get("stage") != stage:
        what = f"holds results of cfem {old.get('stage')}, which cfem {stage} does not replace"
        raise OutputError(what, where=where, do="choose another --out")
    if is_dear(old, precious) and old.get("made_from") != made_from and not force:
        what = "holds results from other inputs that cost too much to lose"
        raise OutputError(what, where=where, do="choose another --out, or --force, which moves them aside")


def set_aside(out: Path, precious: bool, kept: bool = False) -> Path | None:
    """Place for the old content of `out`, stated in a sentence; None where it is cfem's own, and cheap or kept in the
    new content, so that it may be deleted."""
    if not out.is_dir() or not any(out.iterdir()):
        return None
    try:
        old = read_manifest(out)
        foreign = foreign_files(out, old)
        wrong = harm(out, old)
        if not ((is_dear(old, precious) and not kept) or foreign or wrong.endswith(CHANGED)):
            return None
        why = f"cfem did not make {foreign[0]} in it" if foreign else wrong or "it cost much to make"
    except InputError:
        why = "its manifest is damaged"
    return announced(out, free_name(out), why)


def write_beside(path: Path, data: bytes) -> None:
    """Writes a file that a person may have changed: one with other content that is there is moved aside."""
    if path.exists() and path.read_bytes() != data:
        with disk_errors(path):
            os.replace(path, announced(path, free_name(path), "it would be overwritten"))
    write_whole(path, data)


def foreign_files(folder: Path, manifest: dict[str, Any]) -> list[str]:
    """Names of what lies in an artefact folder and is not in its manifest, in order."""
    present = {
        path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_symlink() or not path.is_dir()
    }
    return sorted(present - set(manifest["files"]) - {MANIFEST})


def free_name(name: Path) -> Path:
    """The first `<name>.old-<n>` that nothing has."""
    n = 1
    while os.path.lexists(aside := name.with_name(f"{name.name}.old-{n}")):
        n += 1
    return aside


def announced(folder: Path, aside: Path, why: str) -> Path:
    """Tells the user that the contents of `folder` move to `aside`, and how much room all its set-aside copies take;
    returns `aside`."""
    shown = [os.path.normpath(path) for path in (folder, aside)]
    older = sorted(aside.parent.glob(f"{glob.escape(aside.name.rpartition('.old-')[0])}.old-*"))
    taken = [disk_size(path) for path in (folder, *older)]
    room = f"{size(taken[0])}; with {len(older)} older, {size(sum(taken))}: cfem clean tells what can go"
    say(printable(f"cfem: what was in {shown[0]} is now in {shown[1]}: {why} ({room if older else size(taken[0])})"))
    return aside


def disk_size(path: Path) -> int:
    """Bytes of a file, or of all files of a folder."""
    files = [path, *path.rglob("*")] if path.is_dir() and not path.is_symlink() else [path]
    return sum(file.lstat().st_size for file in files if os.path.lexists(file) and not file.is_dir())


def is_dear(manifest: dict[str, Any], unless_told: bool) -> bool:
    """True if an artefact cost much to make; `unless_told`, where its manifest does not say."""
    return unless_told if manifest["precious"] is None else manifest["precious"]


def is_foreign(out: Path) -> bool:
    """True if there is no manifest, or one that another program wrote. A manifest that no parser reads may be ours."""
    path = out / MANIFEST
    if not path.is_file():
        return True
    try:
        known = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError):
        return False
    return not isinstance(known, dict) or "made_from" not in known or "files" not in known
