"""`cfem simulate-sample`: a scene, its mesh and a plan to a dataset."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from cfem.core.spec import load_spec, meaning
from cfem.core.stage import Options, Stage, run_stage
from cfem.robot.spec import SceneSpec
from cfem.sample.spec import SampleSpec

VERSION = 1


def run(
    spec_path: Path, overrides: Iterable[str], out: Path | None, options: Options, *, workers: int | None = None
) -> dict[str, Any]:
    """The dataset's manifest. Interrupted, the next run goes on from the shards that were finished.

    workers: processes, one a core by default; they change nothing but the time. The scene enters by its values: a
    comment in it makes no dataset stale."""
    spec = load_spec(spec_path, SampleSpec, overrides)
    scene, mesh = spec_path.parent / spec.scene, spec_path.parent / spec.mesh
    stage = Stage(
        name="simulate-sample",
        version=VERSION,
        spec=spec,
        inputs={"mesh": mesh},
        out=out or spec_path.parent / spec.out,
        paths=("scene", "mesh", "out"),
        precious=True,
        extra={"scene": meaning(load_spec(scene, SceneSpec), {"out"})},
    )

    def work(folder: Path) -> dict[str, Any]:
        from cfem.sample.artefact import fill
        from cfem.sample.solver import FiniteElements

        factory = FiniteElements(scene.resolve(), mesh.resolve(), spec.tolerance)
        return fill(folder, spec, factory, stage.made_from(), options.quiet, workers)

    return run_stage(stage, work, options)
