"""Artefacts whose manifest agrees with whatever a test did to their files: what a folder from elsewhere may be."""

import json
from pathlib import Path
from typing import Any

import numpy as np
from typer.testing import CliRunner

from cfem.cli.app import app
from cfem.core.artefact.files import content_sha256, file_sha256
from cfem.core.artefact.manifest import MANIFEST, write_manifest


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


def outcome(*words):
    """Exit code; one line of cfem's on stderr wherever it is not 0, beside its progress."""
    result = CliRunner().invoke(app, list(map(str, words)))
    lines = [line for line in result.stderr.splitlines() if line.startswith("cfem: ")]
    if result.exit_code:
        assert len(lines) == 1, result.stderr
        assert "a defect of cfem" not in lines[0], lines[0]
    return result.exit_code, lines[0] if lines else ""


def refused(own, words, file):
    code, line = outcome(*words)
    assert code == 3 and file in line, line
    return line
