"""`cfem control`: follows the trajectories with learned models and with FE matrices, and judges both in the
plant."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cfem.control.spec import ControlSpec
from cfem.core.spec import load_spec
from cfem.core.stage import Options, Stage, run_stage
from cfem.robot.spec import SceneSpec, scene_meaning

if TYPE_CHECKING:
    from cfem.control.prepared import Prepared

VERSION = 6


def run(spec_path: Path, overrides: Sequence[str], out: Path | None, options: Options) -> dict[str, Any]:
    """The manifest. Results: `trajectories`, per trajectory and controller (`summary.summarise`), and `discretisation`,
    the estimated error of the mesh itself (`mesh_error.mesh_error`)."""
    made, base = stage(spec_path, overrides, out), spec_path.parent
    models = {name: base / path for name, path in made.spec.models.items()}
    return run_stage(made, lambda folder: _work(folder, made.spec, base, made.inputs["mesh"], models), options)


def stage(spec_path: Path, overrides: Sequence[str] = (), out: Path | None = None) -> Stage:
    spec, base = load_spec(spec_path, ControlSpec, overrides), spec_path.parent
    real = spec.loop.real.mesh if spec.loop else None
    controllers = spec.loop.controllers if spec.loop else {}
    policies = {f"policy {name}": base / one.policy for name, one in controllers.items() if one.policy is not None}
    inputs = {"mesh": base / spec.mesh} | {f"model {name}": base / path for name, path in spec.models.items()}
    files = {name: getattr(one, "file", None) or getattr(one, "model", None) for name, one in spec.obstacles.items()}
    inputs |= {f"obstacle {name}": base / file for name, file in files.items() if file}
    scenes = {name: base / one.scene for name, one in spec.obstacles.items() if getattr(one, "scene", None)}
    inputs |= {f"mesh of {name}": one.parent / load_spec(one, SceneSpec).out for name, one in scenes.items()}
    return Stage(
        name="control",
        version=VERSION,
        spec=spec,
        inputs=inputs | policies | ({"real mesh": base / real} if real else {}),
        out=out or base / spec.out,
        paths=("scene", "mesh", "models", "out"),
        precious=spec.plant == "pipe",  # what hardware did cannot be computed again
        extra={"scene": scene_meaning(base / spec.scene)} | {name: scene_meaning(one) for name, one in scenes.items()},
        spec_path=spec_path,
        overrides=overrides,
    )


def _work(folder: Path, spec: ControlSpec, base: Path, mesh: Path, models: dict[str, Path]) -> dict[str, Any]:
    from cfem.control.pilots import pilot_of
    from cfem.control.prepared import prepare

    if spec.gait:
        from cfem.control.crawling.stage import crawl

        return crawl(folder, spec, base, mesh, models)

    at = prepare(spec, base, mesh, models)
    if spec.loop:
        from cfem.control.closed_loop_stage import run_controllers

        pilot = pilot_of(spec, at.robot, next(iter(at.predictors.values())))
        return run_controllers(folder, spec, base, at.robot, at.predictors, at.goals, pilot)
    return _open_loop(folder, spec, base, at)


def _open_loop(folder: Path, spec: ControlSpec, base: Path, at: "Prepared") -> dict[str, Any]:
    """Every goal by every controller, carried out by the plant."""
    from cfem.control.mesh_error import discretisation, states_to_refine
    from cfem.control.summary import headline, summarise
    from cfem.core.progress import progress

    if at.world:
        spec = spec.model_copy(update={"mesh_error": None})  # it does not know contact
    robot, fem = at.robot, at.fem
    surface, places = np.unique(robot.facets, return_inverse=True)
    records, states, results = [], {"X": robot.X[surface], "facets": places.reshape(robot.facets.shape)}, {}
    solved, wanted = [], states_to_refine(at.goals, spec, robot.rest_e)
    with progress("the robot carries out the commands", sum(map(len, at.goals.values()))) as advance:
        for name in at.goals:

            def after(index: int, name: str = name) -> None:
                advance(1)
                if (name, index) in wanted and at.plant.state is not None:
                    solved.append(at.plant.state)

            rows, pictures = _follow(name, spec, at, surface, after)
            records += rows
            states |= pictures
            results[name] = summarise(rows, robot.length)
    refined = discretisation(spec, at.scene, at.mesh, robot, (base / spec.scene).parent, solved)
    if spec.object:
        states["object_points"] = np.sum(surface >= len(robot.X) - robot.object_points)
    np.savez_compressed(folder / "states.npz", **states)
    _write_table(folder / "trajectories.parquet", records, at)
    costs = ("solves", "factorizations", "seconds")
    cost = {key: getattr(fem, key) for key in costs if hasattr(fem, key)} if fem else None
    lines, held, met = headline(results, refined, cost), None, None
    if spec.loads:
        lines.append(f"under the loads the models miss by about {at.load_error:.2g} mm")
    if spec.object:
        held, said = _account(fem, at.touched)
        lines += said
    if at.world:
        figures, said = at.world.said(spec, records)
        lines = [*said, *lines]
        held, met = (held | figures, None) if spec.object else (None, figures)
    if at.touched:
        lines.append(at.touched.sentence())
    return {
        "headline": lines,
        "object": held,
        "obstacles": met,
        "load_error": at.load_error,
        "plant": spec.plant,
        "trajectories": results,
        "discretisation": refined,
        "length": robot.length,
        "fe_cost": cost,
        "nodes": len(robot.X),
    }


def _account(fem, touched) -> tuple[dict[str, Any], list[str]]:
    """How well the object is held and touched: figures of the manifest, lines of the headline."""
    held, lines = {}, []
    if fem.solves:
        held = {"imbalance": fem.imbalance, "softest": fem.softest, "updates": fem.updates}
        lines.append(
            f"object: forces and moments balance to {held['imbalance']:.1e} in every glued state; "
            f"the softest direction in which it is held has {held['softest']:.1e} of the stiffest's stiffness"
        )
    if touched:
        held |= touched.account()
    return held, lines


def _follow(
    name: str, spec: ControlSpec, at: "Prepared", surface: np.ndarray, done: Callable[[int], None]
) -> tuple[list[dict], dict[str, np.ndarray]]:
    """Records of one trajectory, and the deformed nodes of the surface at its goals. done: called with a goal's index
    when the plant stands where the first controller has sent it."""
    from cfem.control.experiment import follow
    from cfem.control.pilots import pilots_of
    from cfem.control.summary import FE_BASED, record

    if spec.object and at.touched:
        at.touched.reset()  # friction depends on the way, and plans begin at rest
    goals, pilots = at.goals[name], pilots_of(spec, at.robot, at.predictors, at.fem, at.world)
    chosen = set(np.linspace(0, len(goals) - 1, min(spec.pictures, len(goals))).round().astype(int).tolist())
    shapes: dict[int, np.ndarray] = {}

    def after(index: int) -> None:
        if at.fem and index in chosen:
            shapes[index] = at.plant.x[surface].astype(np.float32)
        done(index)

    let_go = getattr(spec.trajectories[name], "let_go", False)
    tracked = follow(goals, pilots, at.plant, at.rest_e, FE_BASED, after, let_go)
    fe = {one.index: one for one in tracked if one.controller == FE_BASED}
    rows = [record(name, one, spec.reached, fe.get(one.index)) for one in tracked]
    pictures = {f"{name}/index": np.array(sorted(shapes)), f"{name}/x": np.array([shapes[i] for i in sorted(shapes)])}
    return rows, pictures if shapes else {}


def _write_table(path: Path, records: list[dict], at: "Prepared") -> None:
    from cfem.dataset.writer import write_records

    displacements, forces = zip(*at.robot.actuator_units, strict=True)
    units = {
        "error": "mm",
        "goal": "mm",
        "x_e": "mm",
        "delta_a": displacements,
        "lambda_a": forces,
        "contact": "N",
        "predicted_e": "mm",
        "step_us": "us",
        "seconds": "s",
    }
    rows = (at.world or at.robot).rows.names
    meta = {"rows": list(rows), "rest_e": at.rest_e.tolist(), "length": at.robot.length, "units": units}
    write_records(path, records, meta)
