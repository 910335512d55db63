"""Artefacts whose manifest agrees with whatever a test did to their files: what a folder from elsewhere may be."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.files import content_sha256, file_sha256
from cfem.core.manifest import MANIFEST, write_manifest


def reseal(folder: Path, **changes: Any) -> None:
    """Writes the manifest anew for the files that are there."""
    manifest = json.loads((folder / MANIFEST).read_text()) | changes
    names = sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())
    manifest["files"] = {name: file_sha256(folder / name) for name in names if name != MANIFEST}
    manifest["content"] = content_sha256(manifest["files"])
    write_manifest(folder, manifest)


def change_json(path: Path, change: Any) -> None:
    """`change` takes the data and returns other data, JSON or not: NaN is written as Python writes it."""
    path.write_text(json.dumps(change(json.loads(path.read_text()))))


def change_arrays(path: Path, change: Any) -> None:
    with np.load(path) as file:
        arrays = dict(file)
    np.savez(path, **change(arrays))
