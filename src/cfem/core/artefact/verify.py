"""Verification that artefacts are what their stages wrote: every byte against the manifest, and the manifest against
itself."""

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from cfem.core.artefact.files import file_sha256
from cfem.core.artefact.manifest import MANIFEST, read_manifest
from cfem.core.artefact.place import foreign_files
from cfem.core.errors import CfemError, InputError

ROOTS = (Path("data"), Path("models"))


@dataclass(frozen=True)
class VerifiedArtefact:
    """Verdict on one artefact folder.

    stage: that made it
    files: number of those that agree with their SHA-256
    format: of its manifest, None where cfem wrote it before manifests had one
    damage: a sentence each, which names the file"""

    folder: Path
    stage: str
    files: int
    format: int | None
    damage: tuple[str, ...]


def verify(folders: Sequence[Path] = ()) -> list[VerifiedArtefact]:
    """Verdicts on all artefacts in these folders; in those of ROOTS that are there by default. Raises InputError where
    there is none."""
    roots = list(folders) or [root for root in ROOTS if root.is_dir()]
    for root in roots:
        if not root.is_dir():
            raise InputError("no such folder", where=str(root), do="check the path")
    verified = [judge(folder) for root in roots for folder in artefacts(root)]
    if not verified:
        raise InputError("found no artefact", where=", ".join(map(str, roots or ROOTS)), do="name a folder")
    return verified


def artefacts(root: Path) -> Iterator[Path]:
    """Folders with a manifest, and those with files that no manifest is above, beside or below: an artefact that lost
    its own. Work under way is left out."""
    children = [path for path in sorted(root.iterdir()) if not path.name.startswith(".")]
    folders = [path for path in children if path.is_dir() and not path.is_symlink()]
    loose = len(folders) < len(children)
    below = (path for child in folders for path in child.rglob(MANIFEST))
    if (root / MANIFEST).exists() or (loose and not any(below)):
        yield root
    else:
        for path in folders:
            yield from artefacts(path)


def judge(folder: Path) -> VerifiedArtefact:
    """Verdict on one artefact folder: missing, changed and foreign files."""
    try:
        manifest = read_manifest(folder)
    except CfemError as error:
        return VerifiedArtefact(folder, "", 0, None, (str(error),))
    known = manifest["files"]
    damage = [sentence for name, expected in known.items() if (sentence := _damage(folder / name, expected))]
    foreign = foreign_files(folder, manifest)
    damage += [f"{folder / name}: is foreign: the manifest does not name it" for name in foreign]
    sound = len(known) - (len(damage) - len(foreign))
    return VerifiedArtefact(folder, str(manifest.get("stage", "")), sound, manifest.get("format"), tuple(damage))


def _damage(path: Path, expected: str) -> str:
    """Sentence about a damaged file, empty where the file is whole."""
    if not os.path.lexists(path):
        return f"{path}: is missing"
    try:
        unchanged = file_sha256(path) == expected
    except InputError as error:
        return str(error)
    return "" if unchanged else f"{path}: is damaged: its SHA-256 differs from the manifest"
