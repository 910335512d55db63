"""What all commands share: a stage reads specs and artefact folders, writes one folder, and runs only when it must.

An artefact is a folder with `manifest.json`: which stage made it, the content hash of everything it was made from
(`made_from`), the content hash of what it holds (`content`), every file's SHA-256, results, versions and seconds."""

import os
import shutil
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cfem.core.errors import GateError, InputError, OutputError
from cfem.core.files import content_sha256, file_sha256, locked, read_json, replace_folder, write_json
from cfem.core.provenance import versions
from cfem.core.spec import Spec, meaning

MANIFEST = "manifest.json"


@dataclass(frozen=True)
class Options:
    """The flags that every command takes."""

    force: bool = False
    check: bool = False
    quiet: bool = False


@dataclass(frozen=True)
class Stage:
    """One run of one command.

    name:     of the command, e.g. 'train'
    version:  raised when the stage's output changes meaning for the same inputs
    spec:     everything the user chose (values, not spelling, enter the hash; fields in `paths` do not)
    inputs:   artefact folders (with a manifest) or plain files that the stage reads
    out:      the artefact folder that it makes
    paths:    names of top-level spec fields that are paths; what they point to enters through `inputs`
    precious: True where remaking costs so much that an output from other inputs is kept unless --force"""

    name: str
    version: int
    spec: Spec
    inputs: Mapping[str, Path]
    out: Path
    paths: tuple[str, ...] = ()
    precious: bool = False
    extra: Mapping[str, Any] = field(default_factory=dict)

    def made_from(self) -> str:
        """Content hash of all that determines the output."""
        return content_sha256(
            {
                "stage": self.name,
                "version": self.version,
                "spec": meaning(self.spec, self.paths),
                "inputs": {name: artefact_content(path) for name, path in self.inputs.items()},
                "extra": dict(self.extra),
            }
        )


def artefact_content(path: Path) -> str:
    """Content hash of an artefact folder (from its manifest) or of a plain file."""
    if path.is_dir():
        return str(read_manifest(path)["content"])
    return file_sha256(path)


def read_manifest(folder: Path) -> dict:
    """The manifest of an artefact folder; InputError where the folder is none."""
    if not folder.exists():
        raise InputError("no such artefact", where=str(folder), do="run the stage that makes it")
    manifest = read_json(folder / MANIFEST)
    if "content" not in manifest or "files" not in manifest:
        raise InputError("is no artefact of cfem: its manifest lacks its content hash", where=str(folder))
    return manifest


def artefact_file(folder: Path, name: str) -> Path:
    """Path of a file of an artefact, checked against the manifest's SHA-256. InputError where missing or damaged."""
    known = read_manifest(folder)["files"].get(name)
    if known is None:
        raise InputError(f"holds no {name}", where=str(folder), do="run the stage that makes it")
    if file_sha256(folder / name) != known:
        raise InputError(
            "is damaged: its SHA-256 differs from the manifest",
            where=str(folder / name),
            do="make it anew with --force",
        )
    return folder / name


def is_current(stage: Stage, made_from: str) -> bool:
    """Whether the output exists, is whole (by presence of its files) and was made from the same inputs."""
    try:
        manifest = read_manifest(stage.out)
    except InputError:
        return False
    return manifest.get("made_from") == made_from and all((stage.out / name).exists() for name in manifest["files"])


def run_stage(stage: Stage, work: Callable[[Path], Mapping[str, Any]], options: Options) -> dict[str, Any]:
    """Run `work(folder)`, which fills a new folder and returns results (may carry 'content', a hash of its own), unless
    the output is up to date. The folder takes the output's place only when complete; an error leaves the old one.

    Returns the manifest, with 'status' 'up to date' or 'done'.
    Raises GateError (stale under --check), OutputError (precious output from other inputs, or locked)."""
    made_from = stage.made_from()
    current = is_current(stage, made_from)
    if options.check:
        if not current:
            raise GateError(f"{stage.name}: stale", where=str(stage.out), do=f"run cfem {stage.name}")
        return {**read_manifest(stage.out), "status": "up to date"}
    if current and not options.force:
        return {**read_manifest(stage.out), "status": "up to date"}
    if stage.out.exists() and not options.force:
        if not (stage.out / MANIFEST).exists() and (not stage.out.is_dir() or any(stage.out.iterdir())):
            raise OutputError("exists and was not made by cfem", where=str(stage.out), do="choose another --out")
        if stage.precious and (stage.out / MANIFEST).exists() and not current:
            raise OutputError(
                "holds results from other inputs", where=str(stage.out), do="choose another --out, or --force"
            )
    with locked(stage.out):
        return _work(stage, made_from, work)


def partial_folder(out: Path) -> Path:
    """Where a stage builds its output; kept after an interruption so that a resumable stage can go on."""
    return out.with_name(f".{out.name}.partial")


def _work(stage: Stage, made_from: str, work: Callable[[Path], Mapping[str, Any]]) -> dict[str, Any]:
    partial = partial_folder(stage.out)
    mark = partial / "made_from"
    if not (mark.exists() and mark.read_text() == made_from):
        shutil.rmtree(partial, ignore_errors=True)
        partial.mkdir(parents=True)
        mark.write_text(made_from)
    start = time.perf_counter()
    results = dict(work(partial))
    made = [path for path in sorted(partial.rglob("*")) if path.is_file() and path not in (mark, partial / MANIFEST)]
    files = {path.relative_to(partial).as_posix(): file_sha256(path) for path in made}
    manifest = {
        "stage": stage.name,
        "made_from": made_from,
        "content": results.pop("content", None) or content_sha256(files),
        "inputs": {name: os.path.relpath(path, stage.out) for name, path in stage.inputs.items()},
        "spec": stage.spec.model_dump(),
        "files": files,
        "results": results,
        "versions": versions(),
        "seconds": time.perf_counter() - start,
    }
    write_json(partial / MANIFEST, manifest)
    replace_folder(partial, stage.out)
    (stage.out / mark.name).unlink()  # last: until the folder is in its place, an interrupted run can go on
    return {**manifest, "status": "done"}
