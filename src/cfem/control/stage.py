"""`cfem control`: follows the trajectories with learned models and with FE matrices, and judges both in the
plant."""

from pathlib import Path
from typing import Any

from cfem.control.goals import demand_fits
from cfem.control.spec import ControlSpec
from cfem.core.spec import load_spec
from cfem.core.stage import Command
from cfem.robot.spec import SceneSpec, demand_driven, scene_meaning


def _reads(spec: ControlSpec, base: Path) -> dict[str, Path]:
    inputs = {f"model {name}": base / path for name, path in spec.models.items()}
    files = {name: getattr(one, "file", None) or getattr(one, "model", None) for name, one in spec.obstacles.items()}
    inputs |= {f"obstacle {name}": base / file for name, file in files.items() if file}
    inputs |= {f"mesh of {name}": one.parent / load_spec(one, SceneSpec).out for name, one in _others(spec, base)}
    if spec.loop is None:
        return inputs
    controllers = spec.loop.controllers.items()
    inputs |= {f"policy {name}": base / one.policy for name, one in controllers if one.policy is not None}
    return inputs | ({"real mesh": base / spec.loop.real.mesh} if spec.loop.real.mesh else {})


def _others(spec: ControlSpec, base: Path) -> list[tuple[str, Path]]:
    """Scenes of the soft obstacles, by name."""
    return [(name, base / one.scene) for name, one in spec.obstacles.items() if getattr(one, "scene", None)]


def _work(folder: Path, spec: ControlSpec, base: Path) -> dict[str, Any]:
    """Results: `trajectories`, per trajectory and controller (`summary.summarise`), and `discretisation`, the estimated
    error of the mesh itself (`mesh_error.mesh_error`)."""
    from cfem.control.open_loop import carry_out
    from cfem.control.planners import pilot_of
    from cfem.control.prepared import prepare
    from cfem.control.resume import SoFar

    mesh, models = base / spec.mesh, {name: base / path for name, path in spec.models.items()}
    if spec.gait:
        from cfem.control.crawling.stage import crawl

        return crawl(folder, spec, base, mesh, models)

    if spec.loop:
        from cfem.control.closed_loop_stage import run_controllers

        at = prepare(spec, base, mesh, models)
        pilot = pilot_of(spec, at.robot, next(iter(at.predictors.values())))
        return run_controllers(folder, spec, base, at.robot, at.predictors, at.goals, pilot)
    so_far = SoFar(folder, keep=spec.plant == "fem")
    return carry_out(folder, spec, base, prepare(spec, base, mesh, models, so_far.goals), so_far)


def _agrees(spec: ControlSpec, base: Path) -> None:
    """SpecError where a curve has other numbers than the scene has actuators or effector rows."""
    scene = load_spec(base / spec.scene, SceneSpec)
    demand_driven(scene)
    if spec.object is None and not spec.robots:
        rows = [len(item.axes) for item in scene.effectors]
        aims = [len(item.axes) for item in scene.effectors if item.at != "centre-of-mass"]
        for name, trajectory in spec.trajectories.items():
            demand_fits(name, trajectory, len(scene.actuators), sum(rows), sum(aims))


COMMAND = Command(
    "control",
    9,
    ControlSpec,
    _work,
    ("mesh",),
    outside=("scene", "models"),
    reads=_reads,
    extra=lambda spec, base: (
        {"scene": scene_meaning(base / spec.scene)} | {name: scene_meaning(one) for name, one in _others(spec, base)}
    ),
    agrees=_agrees,
    precious=lambda spec: spec.plant == "pipe",  # what hardware did cannot be computed again
)
run, stage = COMMAND.run, COMMAND.stage
