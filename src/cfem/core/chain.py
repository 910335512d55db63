"""Whether an artefact is what its command would make now, and why not."""

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from cfem.core.changes import changes
from cfem.core.errors import InputError
from cfem.core.files import content_sha256
from cfem.core.kinds import KINDS, model_of
from cfem.core.manifest import read_manifest
from cfem.core.spec import Spec, load_spec
from cfem.core.stage import Stage

NOT_MADE = "not made yet"


def stage_module(kind: str) -> Any:
    """Of the package that a kind of spec belongs to: `stage` describes a command's run, `run` runs it."""
    return import_module(f"{KINDS[kind][0].rpartition('.')[0]}.stage")


def describe(kind: str, spec: Path, overrides: Sequence[str] = (), out: Path | None = None) -> Stage:
    """The run of the command that reads this kind of spec. SpecError, InputError where the spec cannot be read."""
    return stage_module(kind).stage(spec, overrides, out)


def stale(stage: Stage) -> list[str]:
    """Why the output is not what the command would make now, a few words each; none where it is."""
    try:
        manifest = read_manifest(stage.out)
    except InputError:
        return [NOT_MADE if not stage.out.exists() else "its manifest is damaged"]
    missing = [name for name in manifest["files"] if not (stage.out / name).exists()]
    if missing:
        return [f"{missing[0]} is missing"]
    now = stage.origin()
    if content_sha256(now) == manifest.get("made_from"):
        return []
    return changes(manifest.get("origin"), now, _specs(stage))


def _specs(stage: Stage) -> dict[str, Spec]:
    """The stage's own and, where that names one, the scene."""
    scene = getattr(stage.spec, "scene", None)
    if scene is None or stage.spec_path is None:
        return {"spec": stage.spec}
    return {"spec": stage.spec, "scene": load_spec(stage.spec_path.parent / scene, model_of("scene"))}
