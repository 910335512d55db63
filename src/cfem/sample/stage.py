"""`cfem simulate-sample`: a scene, its mesh and a plan to a dataset."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from cfem.condensed.parameters import to_json
from cfem.core.spec import load_spec, meaning
from cfem.core.stage import Options, Stage, run_stage
from cfem.robot.spec import SceneSpec
from cfem.sample.parameters import scene_parameters
from cfem.sample.spec import SampleSpec

VERSION = 4


def run(
    spec_path: Path,
    overrides: Iterable[str],
    out: Path | None,
    options: Options,
    *,
    fill: Callable[..., dict[str, Any]] | None = None,
    workers: int | None = None,
) -> dict[str, Any]:
    """The dataset's manifest. Interrupted, the next run goes on from the shards that were finished.

    workers: processes, one a core by default; they change nothing but the time. The scene enters by its values: a
    comment in it makes no dataset stale. fill: makes the dataset's files; one that samples actively where `spec.until`
    asks for it is `cfem.active.fill.fill`."""
    spec = load_spec(spec_path, SampleSpec, overrides)
    scene, mesh = spec_path.parent / spec.scene, spec_path.parent / spec.mesh
    parameters = scene_parameters(spec.parameters, scene)
    stage = Stage(
        name="simulate-sample",
        version=VERSION,
        spec=spec,
        inputs={"mesh": mesh},
        out=out or spec_path.parent / spec.out,
        paths=("scene", "mesh", "out", "parameters"),  # parameters: by their values, not by their spelling
        precious=True,
        extra={"scene": meaning(load_spec(scene, SceneSpec), {"out"}), "parameters": to_json(parameters)},
    )

    def work(folder: Path) -> dict[str, Any]:
        from cfem.sample import artefact
        from cfem.sample.solver import FiniteElements

        turns = None if spec.contact is None else spec.contact.rotation is not None
        factory = FiniteElements(scene.resolve(), mesh.resolve(), spec.tolerance, parameters, spec.third_order, turns)
        return (fill or artefact.fill)(folder, spec, factory, stage.made_from(), options.quiet, workers)

    return run_stage(stage, work, options)
