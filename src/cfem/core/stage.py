"""What all commands share: a stage reads specs and artefact folders, writes one folder, and runs only when it must.

An artefact is a folder with `manifest.json`: which stage made it, the content hash of everything it was made from
(`made_from`), the content hash of what it holds (`content`), every file's SHA-256 with its size and time, results,
versions and seconds.

It is whole or absent at any moment: the work fills `.<name>.partial` beside it, which takes its place by a rename, all
bytes on disk. Killed, the next run of the same inputs goes on from what is there; of others, it starts over."""

import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from cfem.core.chain import demand_current, stale
from cfem.core.errors import GateError, InputError, StaleError
from cfem.core.files import (
    confined,
    content_sha256,
    file_sha256,
    locked,
    plain,
)
from cfem.core.judgement import with_inherited
from cfem.core.manifest import MANIFEST, harm, is_inside, read_manifest, stamp, write_manifest
from cfem.core.place import demand_replaceable, destination, set_aside
from cfem.core.progress import labelled
from cfem.core.provenance import versions
from cfem.core.replace import recover_folder, replace_folder
from cfem.core.spec import Spec, load_spec, meaning
from cfem.core.unfinished import begin, finish


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
    precious: True where the output costs so much that one from other inputs is kept unless --force, and then moved
              aside rather than deleted
    extra:    what else determines the output: values, or a function that reads them from the inputs
    spec_path, overrides: where the spec is and what --set changed in it, so that it can be read again
    agrees:   SpecError where the spec does not fit the other specs that it names: cheap, and asked before any work"""

    name: str
    version: int
    spec: Spec
    inputs: Mapping[str, Path]
    out: Path
    paths: tuple[str, ...] = ()
    precious: bool = False
    extra: Mapping[str, Any] | Callable[[], Mapping[str, Any]] = field(default_factory=dict)
    spec_path: Path | None = None
    overrides: Sequence[str] = ()
    agrees: Callable[[], None] = lambda: None

    def demand_agreement(self) -> None:
        """SpecError, with its file and line, where the spec does not fit the other specs that it names."""
        with self.spec.locating():
            self.agrees()

    def origin(self, gone: Mapping[str, str] | None = None) -> dict[str, Any]:
        """All that determines the output, as plain data. gone: content hashes of inputs, for those that are not there;
        InputError where there is none."""
        extra = self.extra() if callable(self.extra) else self.extra
        return plain(
            {
                "stage": self.name,
                "version": self.version,
                "spec": meaning(self.spec, self.paths),
                "inputs": {
                    name: gone[name] if gone and name in gone and not path.exists() else artefact_content(path)
                    for name, path in self.inputs.items()
                },
                "extra": dict(extra),
            }
        )

    def made_from(self) -> str:
        """Content hash of all that determines the output."""
        return content_sha256(self.origin())


@dataclass(frozen=True)
class Command:
    """What a command makes of a spec: `stage` describes one run of it, and `run` runs it.

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
        spec, base = self.complete(load_spec(spec_path, self.kind, overrides)), spec_path.parent
        given = {name: base / getattr(spec, name) for name in self.inputs if getattr(spec, name) is not None}
        return Stage(
            name=self.name,
            version=self.version,
            spec=spec,
            inputs=given | dict(self.reads(spec, base) if self.reads else {}),
            out=out or base / spec.out,
            paths=(*self.inputs, *self.outside, "out"),
            precious=self.precious(spec),
            extra=self.extra(spec, base) if self.extra else {},
            spec_path=spec_path,
            overrides=overrides,
            agrees=lambda: self.agrees(spec, base),
        )

    def run(self, spec_path: Path, overrides: Sequence[str], out: Path | None, options: Options) -> dict[str, Any]:
        """The manifest."""
        made = self.stage(spec_path, overrides, out)
        return run_stage(made, lambda folder: self.work(folder, made.spec, spec_path.parent), options)


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
        what = f"holds no {name}: it was made by cfem {manifest.get('stage')}"
        raise InputError(what, where=str(folder), do="check the path in the spec")
    if file_sha256(folder / name) != known:
        raise InputError(
            "is damaged: its SHA-256 differs from the manifest",
            where=str(folder / name),
            do="regenerate it with --force",
        )
    return folder / name


def is_current(stage: Stage, made_from: str) -> bool:
    """Whether the output exists, is whole and was made from the same inputs."""
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
        demand_replaceable(stage.out, stage.name, made_from, stage.precious, options.force)
        with labelled(stage.name):
            return _work(stage, origin, work)


def _demand_inputs_current(stage: Stage, check: bool) -> None:
    """StaleError where one is stale; GateError under --check."""
    seen: set[str] = set()
    try:
        for path in stage.inputs.values():
            demand_current(path, seen)
    except StaleError as error:
        if check:
            raise GateError(f"{stage.name}: stale: {error}") from None
        raise


def _work(stage: Stage, origin: dict[str, Any], work: Callable[[Path], Mapping[str, Any]]) -> dict[str, Any]:
    made_from = content_sha256(origin)
    partial = begin(stage.out, made_from, stage.precious)
    start = time.perf_counter()
    with confined(partial), stage.spec.locating():
        results = with_inherited(work(partial), stage.inputs)
    made = [path for path in sorted(partial.rglob("*")) if path.is_file() and path != partial / MANIFEST]
    files = {path.relative_to(partial).as_posix(): file_sha256(path) for path in made}
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
    replace_folder(partial, stage.out, set_aside(stage.out, stage.precious))
    finish(stage.out)
    return {**manifest, "status": "done"}


def _source(stage: Stage) -> dict[str, Any] | None:
    """The spec from which the command can be run again."""
    if stage.spec_path is None:
        return None
    return {"spec": _relative(stage.spec_path, stage.out), "set": list(stage.overrides)}


def _relative(path: Path, folder: Path) -> str:
    """From the folder itself, wherever links on the way to it or to `path` lead."""
    return os.path.relpath(os.path.realpath(path), os.path.realpath(folder))
