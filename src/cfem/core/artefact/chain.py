"""Whether an artefact is what its command would make now, and why not: its manifest against the specs and inputs that
are there today, all the way up to the scene."""

import os
import shlex
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from cfem.core.artefact.changes import changes
from cfem.core.artefact.files import content_sha256
from cfem.core.artefact.manifest import harm, read_manifest
from cfem.core.artefact.stage_run import Stage
from cfem.core.errors import InputError, StaleError
from cfem.core.kinds import KINDS, model_of
from cfem.core.optional import MissingPackageError
from cfem.core.spec import Spec, load_spec

NOT_MADE = "not made yet"
_KIND_OF = {command: kind for kind, (_, _, command) in KINDS.items()}


def stage_module(kind: str) -> Any:
    """Module `stage` of the package that a kind of spec belongs to: `stage` describes a command's run, `run` runs
    it."""
    return import_module(f"{KINDS[kind][0].rpartition('.')[0]}.stage")


def describe(kind: str, spec: Path, overrides: Sequence[str] = (), out: Path | None = None) -> Stage:
    """The run of the command that reads this kind of spec. SpecError, InputError where the spec cannot be read."""
    return stage_module(kind).stage(spec, overrides, out)


def stale(stage: Stage) -> list[str]:
    """Reasons, a few words each, why the output is not what the command would make now; none where it is. An input that
    is gone is taken for what it was."""
    try:
        manifest = read_manifest(stage.out)
    except InputError:
        return [NOT_MADE if not stage.out.exists() else "its manifest is damaged"]
    if wrong := harm(stage.out, manifest):
        return [wrong]
    recorded = manifest["origin"]
    now = stage.origin(recorded["inputs"] if recorded else None)
    if content_sha256(now) == manifest["made_from"]:
        return []
    return changes(recorded, now, _specs(stage))


def _specs(stage: Stage) -> dict[str, Spec]:
    """The stage's own and, where that names one, the scene."""
    scene = getattr(stage.spec, "scene", None)
    if scene is None or stage.spec_path is None:
        return {"spec": stage.spec}
    return {"spec": stage.spec, "scene": load_spec(stage.spec_path.parent / scene, model_of("scene"))}


def demand_current(artefact: Path, seen: set[str] | None = None) -> None:
    """Raises StaleError where an artefact, or one that it was made from, is not what its command would make now: it
    names the first of them in the order of the pipeline, what changed, and the command. Where the spec of a command is
    gone, or an input of it, nothing is known against the artefact. seen: real paths that were judged before."""
    seen, real = set() if seen is None else seen, os.path.realpath(artefact)
    if real in seen or not os.path.isdir(artefact):
        return
    seen.add(real)
    manifest = read_manifest(artefact)
    for path in manifest["inputs"].values():
        if os.path.isdir(above := os.path.join(real, path)):
            demand_current(Path(os.path.relpath(above)), seen)
    source = manifest["source"]
    if not source:
        return
    spec, overrides = Path(os.path.relpath(os.path.join(real, source["spec"]))), source["set"]
    if not spec.is_file() or manifest["stage"] not in _KIND_OF:
        return
    try:
        why = stale(describe(_KIND_OF[manifest["stage"]], spec, overrides, artefact))
    except (InputError, MissingPackageError):
        return
    if why:
        do = f"run {command(manifest['stage'], spec, overrides, artefact)}, then what reads its result"
        raise StaleError(f"is stale: {'; '.join(why)}", where=os.path.normpath(artefact), do=do)


def command(stage: str, spec: Path, overrides: Sequence[str], out: Path) -> str:
    """Command as it would be typed."""
    words = ["cfem", stage, str(spec), *(word for override in overrides for word in ("--set", override))]
    if os.path.realpath(out) != os.path.realpath(describe(_KIND_OF[stage], spec, overrides).out):
        words += ["--out", os.path.normpath(out)]
    return shlex.join(words)
