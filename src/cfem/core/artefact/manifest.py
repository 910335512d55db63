"""The file that says what an artefact folder is and holds, sealed by a checksum of its own bytes."""

import hashlib
import json
from pathlib import Path, PurePosixPath
from typing import Any

from cfem.core.artefact.files import file_sha256, open_regular, parse_json, plain, write_whole
from cfem.core.errors import InputError
from cfem.core.kinds import present
from cfem.core.reading import Data, checked

MANIFEST = "manifest.json"
FORMAT = 1
CHANGED = "has changed since it was made"
_SEAL = b',\n  "checksum": "'
_END = b'"\n}\n'
_AGAIN = "regenerate it with --force"


class _Results(Data):
    headline: list[str] = []
    page: str = ""


class _Origin(Data):
    """What determined the output, as of `Stage.origin`."""

    spec: dict[str, Any]
    inputs: dict[str, str]
    extra: dict[str, Any] = {}


class _Source(Data):
    """The spec that an artefact was made of."""

    spec: str  # path from the folder
    set: list[str]  # what --set changed


class _Manifest(Data):
    """Fields of a manifest that its readers count on, with defaults where one may lack."""

    content: str
    stage: str = ""
    precious: bool | None = None
    made_from: str = ""
    origin: _Origin | None = None
    source: _Source | None = None
    inputs: dict[str, str] = {}
    spec: dict[str, Any] = {}
    files: dict[str, str] = {}
    stamps: dict[str, list[int]] = {}
    results: _Results = _Results()
    versions: dict[str, str] = {}
    seconds: float = 0.0


_ABSENT = _Manifest(content="").model_dump() | {"results": {}}


def write_manifest(folder: Path, manifest: dict[str, Any]) -> None:
    """Writes the manifest with its format's version first and, last, the SHA-256 of all bytes before that line: a
    flipped bit anywhere in the file shows, be it in a digit or in a blank."""
    data = {"format": FORMAT} | {key: value for key, value in manifest.items() if key not in ("format", "checksum")}
    head = json.dumps(plain(data), indent=2, allow_nan=False).encode().removesuffix(b"\n}")
    write_whole(folder / MANIFEST, head + _SEAL + hashlib.sha256(head).hexdigest().encode() + _END)


def read_manifest(folder: Path) -> dict[str, Any]:
    """The manifest of an artefact folder; InputError where the folder is none, or the manifest is damaged or of a newer
    format. One without format and checksum, as cfem wrote before it had them, is read as it is."""
    if not folder.exists():
        raise InputError("no such artefact", where=str(folder), do="run the stage that makes it")
    if not folder.is_dir():
        do = "give the folder that a command made, which a spec names as `out`"
        raise InputError("is a file, and an artefact is a folder", where=str(folder), do=do)
    path = folder / MANIFEST
    if not path.exists():
        raise InputError(
            "holds no manifest.json: no command of cfem made it",
            where=str(folder),
            do="give a folder that a command made",
        )
    try:
        with open_regular(path) as file:
            data = file.read()
        manifest = parse_json(data)
    except (ValueError, RecursionError) as error:
        raise _damaged(path, str(error)) from None
    if not isinstance(manifest, dict):
        raise _damaged(path, "not a JSON object")
    if manifest.keys() & {"format", "checksum"}:
        head, _, tail = data.rpartition(_SEAL)
        if tail != hashlib.sha256(head).hexdigest().encode() + _END:
            raise _damaged(path, "its checksum differs")
        if manifest.get("format") != FORMAT:
            what = f"has manifest format {manifest.get('format')}; this cfem reads {FORMAT}"
            raise InputError(what, where=str(path), do="update cfem, or regenerate the artefact with --force")
    files = manifest.get("files")
    if "content" not in manifest or not isinstance(files, dict):
        raise InputError("is not an artefact of cfem: its manifest has no content hash", where=str(folder))
    for name in files:
        if not is_inside(name):
            raise _damaged(path, f"names a file outside its folder, {name!r}")
    checked(_Manifest, manifest, str(path), _AGAIN)
    manifest |= {key: value for key, value in _ABSENT.items() if key not in manifest}
    return {**manifest, "stage": present(manifest["stage"])}


def stamp(path: Path) -> list[int]:
    """Size in bytes and time of the last change in ns, by which a changed file is noticed without reading it."""
    state = path.stat()
    return [state.st_size, state.st_mtime_ns]


def harm(folder: Path, manifest: dict[str, Any]) -> str:
    """Fault of the first file that is missing or not as it was written, in a few words; empty where all are whole. Only
    files whose stamp is another are read."""
    for name, expected in manifest["files"].items():
        path = folder / name
        if not path.is_file():
            return f"{name} is missing"
        if stamp(path) != manifest["stamps"].get(name) and file_sha256(path) != expected:
            return f"{name} {CHANGED}"
    return ""


def is_inside(name: str) -> bool:
    """True if a relative name stays below the folder that it is in."""
    path = PurePosixPath(name)
    return bool(path.parts) and not path.is_absolute() and ".." not in path.parts and "\0" not in name


def _damaged(path: Path, why: str) -> InputError:
    return InputError(f"is damaged: {why}", where=str(path), do=_AGAIN)
