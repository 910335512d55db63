"""`cfem verify`: what is damaged, file by file."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cfem.core.artefact.verify import VerifiedArtefact, verify
from cfem.core.console.shown import counted
from cfem.core.errors import InputError


def verify_folders(folders: Sequence[Path], as_json: bool, verified: list[VerifiedArtefact]) -> dict[str, Any] | str:
    """Lines or JSON data about these folders; fills `verified`."""
    verified.extend(verify(folders))
    if as_json:
        return {
            "artefacts": [vars(artefact) | {"damage": list(artefact.damage)} for artefact in verified],
            "damaged": sum(bool(artefact.damage) for artefact in verified),
        }
    width = max(len(str(artefact.folder)) for artefact in verified)
    lines = []
    for artefact in verified:
        form = "no checksum of its manifest (older cfem)" if artefact.format is None else f"format {artefact.format}"
        files = f"{counted(artefact.files, 'file'):>9}"
        lines.append(f"{artefact.folder!s:<{width}}  {'DAMAGED' if artefact.damage else f'whole    {files}, {form}'}")
        lines += [f"  {sentence}" for sentence in artefact.damage]
    return "\n".join(lines)


def demand_whole(verified: Sequence[VerifiedArtefact]) -> None:
    """Raises InputError where anything is damaged."""
    damaged = [artefact for artefact in verified if artefact.damage]
    if damaged:
        what = f"{len(damaged)} of {len(verified)} artefacts damaged, {damaged[0].folder} first"
        raise InputError(what, where="verify", do="regenerate them with --force, or restore their files")
