"""`cfem animate`: a run of `cfem control` as an animation, and as files that ParaView opens with time. It reads the run
and its model; nothing is solved."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from pydantic import Field

from cfem.core.artefact.files import write_whole
from cfem.core.artefact.manifest import read_manifest
from cfem.core.artefact.stage_run import Stage
from cfem.core.errors import InputError
from cfem.core.optional import demand
from cfem.core.spec import Spec, load_spec
from cfem.core.stage import Options, run_stage
from cfem.robot.spec import SceneSpec

if TYPE_CHECKING:
    from cfem.report.shape_history import ShapeHistory
    from cfem.report.viewer import Viewer

VERSION = 1
Format = Literal["gif", "paraview", "still"]
A_GOAL, A_ROUND = 110, 2400  # ms: that a goal is shown at least, and of few goals all together
QUICKEST, SLOWEST = 20, 1000  # ms a frame: quicker ones are slowed down by many viewers


class AnimateSpec(Spec):
    """Options of `cfem animate`."""

    formats: tuple[Format, ...]
    """Kinds of files."""
    frames: int = Field(ge=1)
    """Largest number of shapes of the learned skin."""
    learned: bool
    """Whether the animation shows the learned skin although FE shapes are there."""


def run(
    control: Path,
    out: Path | None,
    options: Options,
    formats: Sequence[Format] = ("gif", "paraview"),
    frames: int = 60,
    learned: bool = False,
) -> dict[str, Any]:
    """Draws a control run and returns the manifest. Results: `files`, by trajectory. control: the folder of the run;
    out: beside it unless given."""
    manifest = read_manifest(control)
    if manifest["stage"] != "control":
        what = f"was made by cfem {manifest['stage'] or '?'}"
        raise InputError(what, where=str(control), do="give the folder that cfem control made")
    models = {name: control / path for name, path in manifest["inputs"].items() if name.startswith("model ")}
    stage = Stage(
        name="animate",
        version=VERSION,
        spec=AnimateSpec(formats=tuple(dict.fromkeys(formats)), frames=frames, learned=learned),
        inputs={"control": control, **models},
        out=out or Path(f"{os.path.normpath(control)}-animation"),
    )
    return run_stage(stage, lambda folder: _work(folder, control, manifest, stage.spec), options)


def _work(folder: Path, control: Path, manifest: Mapping[str, Any], spec: AnimateSpec) -> dict[str, Any]:
    """Writes the films of a run."""
    demand("pyarrow", "matplotlib", "PIL", where="cfem animate")
    from cfem.core.console.progress import progress
    from cfem.report.paraview import write_series
    from cfem.report.run_viewer import viewer_of
    from cfem.report.shape_history import LEARNED, histories

    shapes = list(histories(control, manifest, spec.frames))
    if not shapes or (spec.learned and all(history.kind != LEARNED for history in shapes)):
        raise _nothing_to_draw(control, manifest)
    scene = _scene(control, manifest)
    files: dict[str, list[str]] = {}
    shown = {history.name: history for history in reversed(shapes)}  # FE, which come first, before the learned
    shown |= {history.name: history for history in shapes if spec.learned and history.kind == LEARNED}
    with progress("animation", len(shapes)) as advance:
        for history in shapes:
            written = files.setdefault(history.name, [])
            if "paraview" in spec.formats:
                written.append(write_series(folder, f"{history.name}-{history.kind}", history))
            if shown[history.name] is history:
                written += _pictures(folder, history, viewer_of(history.name, [history], scene), spec.formats)
            advance(1)
    return {"headline": [f"{name}: {', '.join(written)}" for name, written in files.items()], "files": files}


def _pictures(folder: Path, history: "ShapeHistory", viewer: "Viewer", formats: Sequence[Format]) -> list[str]:
    """Names of the files that show one trajectory."""
    from cfem.report.gif import gif, still

    take, pictures = viewer.takes[0], {}
    if "gif" in formats:
        pictures[f"{history.name}.gif"] = gif(viewer, take, _durations(history))
    if "still" in formats:
        pictures[f"{history.name}.png"] = still(viewer, take, history.rest)
    for name, data in pictures.items():
        write_whole(folder / name, data)
    return list(pictures)


def _nothing_to_draw(control: Path, manifest: Mapping[str, Any]) -> InputError:
    """Error that says why there is nothing to draw."""
    if manifest["spec"].get("object") or manifest["spec"].get("design"):
        what = "a learned skin is of the scene's own robot alone, without object or design, and"
    else:
        what = "its model has no skin, and"
    do = "sample with `skin: {}` in sample.yaml and train, export and control again, or control with plant: fem"
    return InputError(f"has no shapes to draw: {what} no FE shapes are asked for or kept", where=str(control), do=do)


def _durations(history: Any) -> list[int]:
    """Durations ms of the shapes: as long as each took; of goals one after the other the same."""
    if not history.in_seconds or len(history.times) < 2:
        return [min(max(A_GOAL, A_ROUND // len(history.times) // 10 * 10), SLOWEST)] * len(history.times)
    steps = np.diff(history.times, append=2 * history.times[-1] - history.times[-2])
    return np.clip(1000 * steps, QUICKEST, SLOWEST).round(-1).astype(int).tolist()


def _scene(control: Path, manifest: Mapping[str, Any]) -> SceneSpec | None:
    """Scene for the cables, where it is still there and stands as it was controlled."""
    if not manifest["source"] or manifest["spec"].get("design"):
        return None
    path = (control / manifest["source"]["spec"]).parent / manifest["spec"]["scene"]
    return load_spec(path, SceneSpec) if path.is_file() else None
