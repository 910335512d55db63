"""Content of artefact folders: the hash of their content, and files checked against the manifest."""

from pathlib import Path

from cfem.core.artefact.files import file_sha256
from cfem.core.artefact.manifest import is_inside, read_manifest
from cfem.core.errors import InputError


def artefact_content(path: Path) -> str:
    """Content hash of an artefact folder (from its manifest) or of a plain file."""
    if path.is_dir():
        return str(read_manifest(path)["content"])
    return file_sha256(path)


def artefact_file(folder: Path, name: str) -> Path:
    """Path of a file of an artefact, checked against the manifest's SHA-256. InputError where missing or damaged."""
    manifest = read_manifest(folder)
    known = manifest["files"].get(name) if is_inside(name) else None
    if known is None:
        first, more = sorted(manifest["files"])[:3], len(manifest["files"]) - 3
        files = ", ".join(first) + (f" and {more} more" if more > 0 else "")
        what = f"holds no {name}: cfem {manifest.get('stage')} made {files} there"
        raise InputError(what, where=str(folder), do="check the path, and what the spec of that stage asks for")
    if file_sha256(folder / name) != known:
        raise InputError(
            "is damaged: its SHA-256 differs from the manifest",
            where=str(folder / name),
            do="regenerate it with --force",
        )
    return folder / name
