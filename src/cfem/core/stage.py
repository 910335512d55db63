"""Machinery of all commands: a stage reads specs and artefact folders, writes one folder, and runs only when it must.

An artefact is a folder with `manifest.json`: which stage made it, the content hash of everything it was made from
(`made_from`), the content hash of what it holds (`content`), every file's SHA-256 with its size and time, results,
versions and seconds.

It is whole or absent at any moment: the work fills `.<name>.partial` beside it, which takes its place by a rename, all
bytes on disk. Killed, the next run of the same inputs goes on from what is there; of others, it starts over."""

import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from cfem.core.artefact.chain import demand_current, stale
from cfem.core.artefact.files import (
    confined,
    content_sha256,
    file_sha256,
    locked,
)
from cfem.core.artefact.judgement import with_inherited
from cfem.core.artefact.manifest import MANIFEST, harm, read_manifest, stamp, write_manifest
from cfem.core.artefact.place import demand_replaceable, destination, set_aside
from cfem.core.artefact.provenance import versions
from cfem.core.artefact.replace import recover_folder, replace_folder
from cfem.core.artefact.stage_run import Stage
from cfem.core.artefact.unfinished import begin, finish
from cfem.core.console.progress import labelled
from cfem.core.errors import GateError, InputError, StaleError
from cfem.core.spec import Spec, load_spec


@dataclass(frozen=True)
class Options:
    """The flags that every command takes."""

    force: bool = False
    check: bool = False
    quiet: bool = False


@dataclass(frozen=True)
class Command:
    """A command of a pipeline: what it makes of a spec. `stage` describes one run of it, and `run` runs it.

    name, version: as of `Stage`; kind: of the spec
    work:    work(folder, spec, base) fills the folder and returns results; base: the folder of the spec, to which its
             paths are relative
    inputs:  fields of the spec that are paths of inputs, where they are given
    outside: other fields that do not enter the hash as they are written
    reads:   reads(spec, base): inputs besides, by name
    extra:   extra(spec, base): that of `Stage`
    agrees:  agrees(spec, base): that of `Stage`
    complete: complete(spec): with what this machine decides where the spec does not
    precious: precious(spec): that of `Stage`"""

    name: str
    version: int
    kind: type[Spec]
    work: Callable[[Path, Any, Path], Mapping[str, Any]]
    inputs: tuple[str, ...] = ()
    outside: tuple[str, ...] = ()
    reads: Callable[[Any, Path], Mapping[str, Path]] | None = None
    extra: Callable[[Any, Path], Any] | None = None
    agrees: Callable[[Any, Path], None] = lambda spec, base: None
    complete: Callable[[Any], Any] = lambda spec: spec
    precious: Callable[[Any], bool] = lambda spec: False

    def stage(self, spec_path: Path, overrides: Sequence[str] = (), out: Path | None = None) -> Stage:
        """Stage of a spec: what it reads, what determines its output, and where that goes."""
        spec, base = self.complete(load_spec(spec_path, self.kind, overrides)), spec_path.parent
        stated = {name: base / getattr(spec, name) for name in self.inputs if getattr(spec, name) is not None}
        return Stage(
            name=self.name,
            version=self.version,
            spec=spec,
            inputs=stated | dict(self.reads(spec, base) if self.reads else {}),
            out=out or base / spec.out,
            paths=(*self.inputs, *self.outside, "out"),
            precious=self.precious(spec),
            extra=self.extra(spec, base) if self.extra else {},
            spec_path=spec_path,
            overrides=overrides,
            agrees=lambda: self.agrees(spec, base),
        )

    def run(self, spec_path: Path, overrides: Sequence[str], out: Path | None, options: Options) -> dict[str, Any]:
        """Runs the command on a spec and returns the manifest."""
        stage_run = self.stage(spec_path, overrides, out)
        return run_stage(stage_run, lambda folder: self.work(folder, stage_run.spec, spec_path.parent), options)


def is_current(stage: Stage, made_from: str) -> bool:
    """True if the output exists, is whole and was made from the same inputs."""
    try:
        manifest = read_manifest(stage.out)
        return manifest.get("made_from") == made_from and not harm(stage.out, manifest)
    except InputError:
        return False


def run_stage(stage: Stage, work: Callable[[Path], Mapping[str, Any]], options: Options) -> dict[str, Any]:
    """Run `work(folder)`, which fills a new folder and returns results (may carry 'content', a hash of its own), unless
    the output is up to date. The folder takes the output's place only when complete; an error leaves the old one.

    Returns the manifest, with 'status' 'up to date' or 'done'.
    Raises GateError (stale under --check), OutputError (precious output from other inputs, or locked), InputError (an
    input is stale)."""
    stage.demand_agreement()
    _demand_inputs_current(stage, options.check)
    origin = stage.origin()
    made_from = content_sha256(origin)
    if is_current(stage, made_from) and not (options.force and not options.check):
        return {**read_manifest(stage.out), "status": "up to date"}
    if options.check:
        what = f"{stage.name}: stale: {'; '.join(stale(stage)) or 'it is to be made again'}"
        raise GateError(what, where=os.path.normpath(stage.out), do=f"run cfem {stage.name}")
    stage = replace(stage, out=destination(stage.out))
    with locked(stage.out):
        recover_folder(stage.out)
        if not options.force and is_current(stage, made_from):
            return {**read_manifest(stage.out), "status": "up to date"}
        kept = stage.extended() and not options.force
        demand_replaceable(stage.out, stage.name, made_from, stage.precious, options.force or kept)
        with labelled(stage.name):
            return _work(stage, origin, work, kept)


def _demand_inputs_current(stage: Stage, check: bool) -> None:
    """Raises StaleError where an input is stale; GateError under --check."""
    seen: set[str] = set()
    try:
        for path in stage.inputs.values():
            demand_current(path, seen)
    except StaleError as error:
        if check:
            raise GateError(f"{stage.name}: stale: {error}") from None
        raise


def _work(
    stage: Stage, origin: dict[str, Any], work: Callable[[Path], Mapping[str, Any]], kept: bool
) -> dict[str, Any]:
    """Manifest of a stage after its work, whose output has taken its place. kept: whether the output holds all that was
    there."""
    made_from = content_sha256(origin)
    partial = begin(stage.out, made_from, stage.precious)
    start = time.perf_counter()
    with confined(partial), stage.spec.locating():
        results = with_inherited(work(partial), stage.inputs)
    written = [path for path in sorted(partial.rglob("*")) if path.is_file() and path != partial / MANIFEST]
    files = {path.relative_to(partial).as_posix(): file_sha256(path) for path in written}
    manifest = {
        "stage": stage.name,
        "precious": stage.precious,
        "made_from": made_from,
        "origin": origin,
        "source": _source(stage),
        "content": results.pop("content", None) or content_sha256(files),
        "inputs": {name: _relative(path, stage.out) for name, path in stage.inputs.items()},
        "spec": stage.spec.model_dump(),
        "files": files,
        "stamps": {name: stamp(partial / name) for name in files},
        "results": results,
        "versions": versions(),
        "seconds": time.perf_counter() - start,
    }
    write_manifest(partial, manifest)
    replace_folder(partial, stage.out, set_aside(stage.out, stage.precious, kept))
    finish(stage.out)
    return {**manifest, "status": "done"}


def _source(stage: Stage) -> dict[str, Any] | None:
    """The spec from which the command can be run again."""
    if stage.spec_path is None:
        return None
    return {"spec": _relative(stage.spec_path, stage.out), "set": list(stage.overrides)}


def _relative(path: Path, folder: Path) -> str:
    """Path relative to the folder itself, wherever links on the way to it or to `path` lead."""
    return os.path.relpath(os.path.realpath(path), os.path.realpath(folder))
