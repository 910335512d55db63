"""What cfem has set aside, `NAME.old-N` beside NAME, and unfinished work, `.NAME.partial`: how much room it takes and
what of it is dear."""

import re
import shutil
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

from cfem.core.artefact.files import disk_errors, locked
from cfem.core.artefact.manifest import MANIFEST, harm, read_manifest
from cfem.core.artefact.place import disk_size, foreign_files, is_dear, is_foreign
from cfem.core.artefact.unfinished import mark_of, read_mark
from cfem.core.console.shown import duration
from cfem.core.errors import InputError, OutputError

COPY, COSTLY, YOURS = "copy", "costly", "yours"
_OLD = re.compile(r"(?P<name>.+)\.old-[0-9]+")
_PARTIAL = re.compile(r"\.(?P<name>.+)\.partial")


@dataclass(frozen=True)
class Aside:
    """A folder that was set aside."""

    path: Path
    bytes: int
    worth: str  # copy (of what is in place, or cheap to make), costly (took long), yours (not made by cfem alone)
    why: str  # in words


def set_asides(roots: Sequence[Path]) -> list[Aside]:
    """Folders set aside below these, sorted by path. InputError where one of them is no folder."""
    for root in roots:
        if not root.is_dir():
            raise InputError("no such folder", where=str(root), do="check the path")
    return [Aside(path, disk_size(path), *_judged(path)) for root in roots for path in sorted(_below(root))]


def remove(aside: Aside) -> None:
    """Deletes it, and the mark beside unfinished work. OutputError where a command works in it by now."""
    target = _target(aside.path)
    with disk_errors(aside.path), locked(target) if target else nullcontext():
        shutil.rmtree(aside.path)
        mark_of(target or aside.path).unlink(missing_ok=True)


def _target(path: Path) -> Path | None:
    """The artefact that cfem's own unfinished work `path` is to become; None where it is no such work."""
    named = _PARTIAL.fullmatch(path.name)
    target = path.with_name(named["name"]) if named and path.is_dir() and not path.is_symlink() else None
    return target if target and read_mark(mark_of(target)) else None


def _in_use(target: Path) -> bool:
    """True if a command works there."""
    try:
        with locked(target):
            return False
    except OutputError:
        return True


def _below(folder: Path) -> Iterator[Path]:
    """Folders below `folder` that are set aside, or unfinished and of no command that runs now."""
    for path in folder.iterdir():
        if _OLD.fullmatch(path.name) and not path.is_symlink():
            yield path
        elif target := _target(path):
            if any(path.iterdir()) and not _in_use(target):
                yield path
        elif path.is_dir() and not path.is_symlink() and not (path / MANIFEST).exists():
            yield from _below(path)


def _judged(path: Path) -> tuple[str, str]:
    """Worth of what was set aside, and the reason."""
    if _target(path):
        return COSTLY, "unfinished work, which goes on when its command runs again"
    name = _OLD.fullmatch(path.name)["name"]
    if path.is_dir() and name.endswith(".partial") and read_mark(mark_of(path)):
        return COSTLY, "unfinished work, which goes on when its spec is back"
    if not path.is_dir() or is_foreign(path):
        return YOURS, "cfem did not make it, or a person changed it"
    try:
        manifest = read_manifest(path)
    except InputError:
        return YOURS, "its manifest is damaged"
    foreign, wrong = foreign_files(path, manifest), harm(path, manifest)
    if foreign or wrong:
        return YOURS, f"cfem did not make {foreign[0]} in it" if foreign else wrong
    if manifest["content"] == _content(path.with_name(name)):
        return COPY, f"the same is in {name}"
    if is_dear(manifest, False):
        return COSTLY, f"cfem {manifest['stage']} took {duration(manifest['seconds'])} to make it"
    return COPY, f"cfem {manifest['stage']} makes it again in {duration(manifest['seconds'])}"


def _content(folder: Path) -> str | None:
    """The checksum of an artefact that is whole, None where there is none."""
    try:
        manifest = read_manifest(folder)
    except InputError:
        return None
    return None if harm(folder, manifest) else manifest["content"]
