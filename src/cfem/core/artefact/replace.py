"""A folder takes another's place in one step, and what a process that died in between has left is put right."""

import glob
import os
import shutil
from contextlib import suppress
from pathlib import Path

from cfem.core.artefact.files import disk_errors, sync_tree
from cfem.core.artefact.manifest import MANIFEST
from cfem.core.artefact.place import is_foreign
from cfem.core.system import exchange, sync


def replace_folder(new: Path, target: Path, aside: Path | None = None) -> None:
    """Replaces `target` by the finished folder `new`. The old content is moved to `aside`, or deleted where
    that is None. A reader finds one or the other at any moment where the system can swap folders. Where it cannot, two
    renames do it; a process that is killed between them leaves the old folder under another name, from which
    `recover_folder` puts it back unless that is `aside`."""
    old = aside or target.with_name(f".{target.name}.{os.getpid()}.old")
    with disk_errors(target):
        sync_tree(new)
        if not _swapped(new, target, old):
            if target.exists():
                os.replace(target, old)
            try:
                os.replace(new, target)
            except OSError:
                if old.exists():
                    os.replace(old, target)
                raise
        sync(target.parent)
    if aside is None:
        discard(old)


def _swapped(new: Path, target: Path, old: Path) -> bool:
    """Replaces `target` in one step, its old content now at `old`, and returns True; False where nothing has changed.
    Nothing has changed where it was not."""
    if not target.is_dir() or target.is_symlink():
        return False
    os.replace(new, old)
    try:
        exchanged = exchange(old, target)
    except OSError:
        exchanged = False
    if not exchanged:
        os.replace(old, new)
    return exchanged


def recover_folder(target: Path) -> None:
    """Undoes a replacement that was cut in two, and removes what others left; folders that cfem did not make stay. To
    be called by the holder of its lock alone."""
    with disk_errors(target):
        for old in sorted(target.parent.glob(f".{glob.escape(target.name)}.[0-9]*.old")):
            if not _is_own(old):
                continue
            if target.exists():
                discard(old)
            else:
                os.replace(old, target)


def discard(artefact: Path) -> None:
    """Deletes an artefact, its manifest last: what is left of it where the disk refuses is known for cfem's own."""
    if not artefact.is_dir():
        return
    for path in artefact.iterdir():
        if path.name == MANIFEST:
            continue
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)
        else:
            with suppress(OSError):
                path.unlink()
    if {path.name for path in artefact.iterdir()} <= {MANIFEST}:
        shutil.rmtree(artefact, ignore_errors=True)


def _is_own(folder: Path) -> bool:
    return not folder.is_symlink() and folder.is_dir() and (not any(folder.iterdir()) or not is_foreign(folder))
