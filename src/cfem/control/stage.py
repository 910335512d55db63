"""`cfem control`: follows the trajectories with learned models and with FE matrices, and judges both in the
plant."""

from pathlib import Path
from typing import Any

from cfem.control.closed_loop.run_spec import ClosedLoopSpec
from cfem.control.crawling.spec import CrawlingSpec
from cfem.control.holding.spec import HoldingSpec
from cfem.control.spec import ControlSpec
from cfem.control.task.goals.from_spec import demand_fits, read_goals
from cfem.control.task.goals.trajectory_spec import GoalsSpec
from cfem.control.task.obstacles.spec import ObstaclesSpec
from cfem.control.task.run_spec import RunSpec, TrackingSpec
from cfem.core.spec import load_spec
from cfem.core.stage import Command
from cfem.robot.spec import SceneSpec, demand_driven, scene_meaning


def _reads(spec: RunSpec, base: Path) -> dict[str, Path]:
    """Artefacts and files besides the mesh, by name."""
    inputs = {f"model {name}": base / path for name, path in spec.models.items()}
    if isinstance(spec, TrackingSpec):
        files = {name: getattr(trajectory, "file", None) for name, trajectory in spec.trajectories.items()}
        inputs |= {f"goals {name}": base / path for name, path in files.items() if path is not None}
    if isinstance(spec, ObstaclesSpec):
        inputs |= {f"obstacle {name}": base / path for name, path in spec.files.items()}
        scenes = _scenes_of_obstacles(spec, base)
        inputs |= {f"mesh of {name}": path.parent / load_spec(path, SceneSpec).out for name, path in scenes.items()}
    if isinstance(spec, ClosedLoopSpec):
        controllers, mesh = spec.loop.controllers.items(), spec.loop.real.mesh
        inputs |= {f"policy {name}": base / item.policy for name, item in controllers if item.policy is not None}
        inputs |= {"real mesh": base / mesh} if mesh else {}
    return inputs


def _scenes_of_obstacles(spec: RunSpec, base: Path) -> dict[str, Path]:
    """Scenes of the soft obstacles, by name."""
    if not isinstance(spec, ObstaclesSpec):
        return {}
    return {name: base / path for name, path in spec.scenes.items()}


def _work(folder: Path, spec: RunSpec, base: Path) -> dict[str, Any]:
    """Results: `trajectories`, per trajectory and controller (`summary.summarise`), and `discretisation`, the estimated
    error of the mesh itself (`mesh_error.mesh_error`)."""
    from cfem.control.open_loop.planners import pilot_of
    from cfem.control.open_loop.resume import KeptRun
    from cfem.control.open_loop.run import carry_out
    from cfem.control.task.prepared import prepare

    mesh, models = base / spec.mesh, {name: base / path for name, path in spec.models.items()}
    if isinstance(spec, CrawlingSpec):
        from cfem.control.crawling.stage import crawl

        return crawl(folder, spec, base, mesh, models)
    if isinstance(spec, ClosedLoopSpec):
        from cfem.control.closed_loop.stage import run_controllers

        prepared = prepare(spec, base, mesh, models)
        pilot = pilot_of(spec, prepared.robot, next(iter(prepared.predictors.values())))
        return run_controllers(folder, spec, base, prepared.robot, prepared.predictors, prepared.goals, pilot)
    kept_run = KeptRun(folder, keep=spec.plant == "fem")
    return carry_out(folder, spec, base, prepare(spec, base, mesh, models, kept_run.goals), kept_run)


def _agrees(spec: RunSpec, base: Path) -> None:
    """Raises SpecError where a curve has other numbers than the scene has actuators or effector rows."""
    scene = load_spec(base / spec.scene, SceneSpec)
    demand_driven(scene)
    if isinstance(spec, TrackingSpec) and not isinstance(spec, HoldingSpec):
        rows = [len(item.axes) for item in scene.effectors]
        aimed = [f"{item.name}.{axis}" for item in scene.effectors for axis in item.axes if item.at != "centre-of-mass"]
        for name, trajectory in spec.trajectories.items():
            demand_fits(name, trajectory, len(scene.actuators), sum(rows), len(aimed))
            if isinstance(trajectory, GoalsSpec) and trajectory.file is not None:
                read_goals(base / trajectory.file, aimed)


COMMAND = Command(
    "control",
    12,
    ControlSpec,
    _work,
    ("mesh",),
    outside=("scene", "models"),
    reads=_reads,
    extra=lambda spec, base: (
        {"scene": scene_meaning(base / spec.scene)}
        | {name: scene_meaning(path) for name, path in _scenes_of_obstacles(spec, base).items()}
    ),
    agrees=_agrees,
    precious=lambda spec: spec.plant == "device",  # what hardware did cannot be computed again
)
run, stage = COMMAND.run, COMMAND.stage
