"""`cfem verify`: what is damaged, file by file."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cfem.core.artefact.verify import VerifiedArtefact, verify
from cfem.core.errors import InputError


def verify_folders(folders: Sequence[Path], as_json: bool, found: list[VerifiedArtefact]) -> dict[str, Any] | str:
    """Fills `found`; what to print."""
    found.extend(verify(folders))
    if as_json:
        return {
            "artefacts": [vars(one) | {"damage": list(one.damage)} for one in found],
            "damaged": sum(bool(one.damage) for one in found),
        }
    width = max(len(str(one.folder)) for one in found)
    lines = []
    for one in found:
        form = "no checksum of its manifest (older cfem)" if one.format is None else f"format {one.format}"
        files = f"{one.files:3d} file{'s' if one.files != 1 else ''}"
        lines.append(f"{one.folder!s:<{width}}  {'DAMAGED' if one.damage else f'whole    {files}, {form}'}")
        lines += [f"  {sentence}" for sentence in one.damage]
    return "\n".join(lines)


def demand_whole(found: Sequence[VerifiedArtefact]) -> None:
    """Raises InputError where anything is damaged."""
    damaged = [one for one in found if one.damage]
    if damaged:
        what = f"{len(damaged)} of {len(found)} artefacts damaged, {damaged[0].folder} first"
        raise InputError(what, where="verify", do="regenerate them with --force, or restore their files")
