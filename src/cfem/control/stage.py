"""`cfem control`: follows the trajectories with learned models and with FE matrices, and judges both in the
plant."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from cfem.control.spec import ControlSpec
from cfem.core.actuator_units import demand_units
from cfem.core.errors import SpecError
from cfem.core.spec import load_spec
from cfem.core.stage import Options, Stage, run_stage
from cfem.robot.spec import scene_meaning

VERSION = 3


def run(spec_path: Path, overrides: Sequence[str], out: Path | None, options: Options) -> dict[str, Any]:
    """The manifest. Results: `trajectories`, per trajectory and controller (`summary.summarise`), and `discretisation`,
    the estimated error of the mesh itself (`mesh_error.mesh_error`)."""
    made, base = stage(spec_path, overrides, out), spec_path.parent
    models = {name: base / path for name, path in made.spec.models.items()}
    return run_stage(made, lambda folder: _work(folder, made.spec, base, made.inputs["mesh"], models, options), options)


def stage(spec_path: Path, overrides: Sequence[str] = (), out: Path | None = None) -> Stage:
    spec, base = load_spec(spec_path, ControlSpec, overrides), spec_path.parent
    real = spec.loop.real.mesh if spec.loop else None
    controllers = spec.loop.controllers if spec.loop else {}
    policies = {f"policy {name}": base / one.policy for name, one in controllers.items() if one.policy is not None}
    inputs = {"mesh": base / spec.mesh} | {f"model {name}": base / path for name, path in spec.models.items()}
    inputs |= {f"obstacle {name}": base / one.file for name, one in spec.obstacles.items() if one.kind == "mesh"}
    return Stage(
        name="control",
        version=VERSION,
        spec=spec,
        inputs=inputs | policies | ({"real mesh": base / real} if real else {}),
        out=out or base / spec.out,
        paths=("scene", "mesh", "models", "out"),
        precious=spec.plant == "pipe",  # what hardware did cannot be computed again
        extra={"scene": scene_meaning(base / spec.scene)},
        spec_path=spec_path,
        overrides=overrides,
    )


def _work(
    folder: Path, spec: ControlSpec, base: Path, mesh: Path, models: dict[str, Path], options: Options
) -> dict[str, Any]:
    from cfem.control.goals import goals_of
    from cfem.control.loads import carrying
    from cfem.control.mesh_error import discretisation, states_to_refine
    from cfem.control.summary import headline, summarise
    from cfem.core.progress import progress
    from cfem.plant.fem_plant import FemPlant
    from cfem.plant.model_plant import ModelPlant

    scene_and_mesh, robot, predictors, shift = _loaded(spec, base, mesh, models)
    demand_units(spec, robot.actuator_units)
    world = touched = under = None
    if spec.object:
        from cfem.control.assembled import assembled, touching

        touched = touching(spec, robot) if spec.object.law != "bilateral" else None
        robot, predictors, fem = assembled(spec, robot, predictors, models)
        plant = touched or fem
    else:
        _demand_same_rows(robot, predictors, models)
        robot, predictors = carrying(spec, robot, predictors, models)
        fem, rest_e = FemPlant(robot) if spec.plant == "fem" else None, robot.rest_e
        if spec.obstacles:
            from cfem.control.among import among

            under = _load_error(spec, predictors)
            world, predictors, touched = among(spec, base, robot, predictors, models)
            rest_e = world.rest(rest_e)
        plant = (touched or fem) if fem else ModelPlant(next(iter(predictors.values())), rest_e)
    goals = {name: goals_of(name, trajectory, robot, fem, shift) for name, trajectory in spec.trajectories.items()}
    if world:
        goals = {name: world.goals(points) for name, points in goals.items()}
        spec = spec.model_copy(update={"mesh_error": None})  # contact has no estimate of it
    if spec.loop:
        from cfem.control.closed_loop_stage import run_controllers

        pilot = _pilot(spec, robot, next(iter(predictors.values())))
        return run_controllers(folder, spec, base, robot, predictors, goals, pilot)

    surface, places = np.unique(robot.facets, return_inverse=True)
    records, states, results = [], {"X": robot.X[surface], "facets": places.reshape(robot.facets.shape)}, {}
    solved, wanted = [], states_to_refine(goals, spec, robot.rest_e)
    with progress("the robot carries out the commands", sum(map(len, goals.values()))) as advance:
        for name, points in goals.items():

            def after(index: int, name: str = name) -> None:
                advance(1)
                if (name, index) in wanted and plant.state is not None:
                    solved.append(plant.state)

            rows, pictures = _follow(name, points, spec, robot, predictors, plant, fem, surface, after, world)
            records += rows
            states |= pictures
            results[name] = summarise(rows, robot.length)
    refined = discretisation(spec, *scene_and_mesh, robot, (base / spec.scene).parent, solved)
    if spec.object:
        states["object_points"] = np.sum(surface >= len(robot.X) - robot.object_points)
    np.savez_compressed(folder / "states.npz", **states)
    _write_table(folder / "trajectories.parquet", records, robot)
    costs = ("solves", "factorizations", "seconds")
    cost = {key: getattr(fem, key) for key in costs if hasattr(fem, key)} if fem else None
    lines, held, met = headline(results, refined, cost), None, None
    under = _load_error(spec, predictors) if under is None else under
    if spec.loads:
        lines.append(f"under the loads the models miss by about {under:.2g} mm, of second order in the loads")
    if spec.object:
        held, said = _account(fem, touched)
        lines += said
    if world:
        met, said = world.said(spec, records)
        lines = [*said, *lines, touched.sentence()]
    return {
        "headline": lines,
        "object": held,
        "obstacles": met,
        "load_error": under,
        "plant": spec.plant,
        "trajectories": results,
        "discretisation": refined,
        "length": robot.length,
        "fe_cost": cost,
        "nodes": len(robot.X),
    }


def _loaded(spec: ControlSpec, base: Path, mesh: Path, models: dict[str, Path]) -> tuple:
    """Scene and mesh, the robot, its models, and by how much goals move with the design (n_e,) mm, empty without one.
    InputError where a model is of another robot."""
    from cfem.predict.load import load_model
    from cfem.robot.build import build_robot
    from cfem.robot.load import load_scene_and_mesh
    from cfem.robot.same import demand_robot

    scene_and_mesh = load_scene_and_mesh(base / spec.scene, mesh)
    predictors = {name: load_model(path, spec.runtime) for name, path in models.items()}
    for name, predictor in predictors.items():
        do = f"train a model of {base / spec.scene}, or name the scene of this one"
        demand_robot(scene_and_mesh[0], predictor.meta.get("robot"), models[name], do)
    if not spec.design:
        return scene_and_mesh, build_robot(*scene_and_mesh), predictors, np.zeros(0)
    from cfem.control.design import designed

    return scene_and_mesh, *designed(*scene_and_mesh, predictors, spec.design)


def _load_error(spec: ControlSpec, predictors) -> float | None:
    """mm, None without loads."""
    return max(model.meta["wrench_error"] for model in predictors.values()) if spec.loads else None


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
        lines.append(touched.sentence())
    return held, lines


def _demand_same_rows(robot, predictors, models) -> None:
    from cfem.core.errors import InputError

    for name, predictor in predictors.items():
        if predictor.rows != robot.rows:
            what = f"is a model of another robot: it {predictor.rows.difference(robot.rows, 'the scene')}"
            raise InputError(what, where=str(models[name]), do="train a model on samples of this scene")


def _follow(
    name: str, goals: np.ndarray, spec: ControlSpec, robot, predictors, plant, fem, surface, done, world=None
) -> tuple[list, dict]:
    """Records of one trajectory, and the deformed nodes of the surface at its goals. done: called with a goal's index
    when the plant stands where the first controller has sent it."""
    from cfem.control.experiment import follow
    from cfem.control.summary import FE_BASED, record

    first, predictor = next(iter(predictors.items()))
    searched = _pilot(spec, robot, predictor)
    if world:
        searched = world.pilot(searched)
        predictors = {
            name: replace(model, before=None, at=None) for name, model in predictors.items()
        }  # a way of its own
    settings, rest_e = searched.settings, world.rest(robot.rest_e) if world else robot.rest_e
    pilots = {name: replace(searched, model=model) for name, model in predictors.items()} | {
        f"{first}@{n}": replace(
            searched, model=_updated_once(predictor), settings=replace(settings, iterations=n), approach=settings
        )
        for n in spec.fewer_iterations
    }
    if spec.fe_based:
        pilots[FE_BASED] = replace(searched, model=fem, settings=replace(settings, tolerance=spec.fe_tolerance))

    chosen = set(np.linspace(0, len(goals) - 1, min(spec.pictures, len(goals))).round().astype(int).tolist())
    shapes: dict[int, np.ndarray] = {}

    def after(index: int) -> None:
        if fem and index in chosen:
            shapes[index] = plant.x[surface].astype(np.float32)
        done(index)

    tracked = follow(goals, pilots, plant, rest_e, FE_BASED, after)
    fe = {one.index: one for one in tracked if one.controller == FE_BASED}
    rows = [record(name, one, spec.reached, fe.get(one.index)) for one in tracked]
    pictures = {f"{name}/index": np.array(sorted(shapes)), f"{name}/x": np.array([shapes[i] for i in sorted(shapes)])}
    return rows, pictures if shapes else {}


def _updated_once(model):
    """With one update of the object's pose at each inverse step, as the paper has it, where there is an object."""
    from cfem.condensed.coupling import Coupled
    from cfem.predict.among import Among

    if isinstance(model, Among):
        return replace(model, before=None, at=None)  # where it stands is its own
    return Coupled(model.holds, model.object, model.home, 1) if isinstance(model, Coupled) else model


def _limits(spec: ControlSpec, robot):
    from cfem.control.inverse import Limits

    limits = Limits.of(robot.reach, robot.unilateral)
    if robot.forces is not None:
        limits = replace(limits, lambda_a=robot.forces)
    if spec.search.largest_force is None:
        return limits
    bound = spec.search.largest_force
    return replace(limits, lambda_a=np.clip(limits.lambda_a, -bound, bound))


def _weights(spec: ControlSpec, robot) -> np.ndarray:
    stated, weights = spec.search.weights, robot.aims.astype(float)
    if stated is not None and len(stated) == robot.aims.sum():
        weights[robot.aims] = stated
    elif stated is not None:
        weights = np.array(stated)
    if len(weights) != robot.rows.n_e:
        raise SpecError(
            f"has {len(weights)} weights, and the robot {robot.rows.n_e} effector rows", where="search.weights"
        )
    return weights


def _pilot(spec: ControlSpec, robot, model):
    """What searches for a goal with `model`, as the spec says."""
    from cfem.control.inverse import ridge_of
    from cfem.control.loop import Settings
    from cfem.control.tick import Pilot

    search = spec.search
    return Pilot(
        model,
        "displacement",
        "equilibrium",
        _limits(spec, robot),
        _weights(spec, robot),
        ridge_of(search.regularisation, robot.reach, robot.length),
        Settings(search.iterations, search.tolerance, search.step, backend=search.qp),
        preload=search.preload,
        damping=ridge_of(search.damping, robot.reach, robot.length),
    )


def _write_table(path: Path, records: list[dict], robot) -> None:
    from cfem.dataset.writer import write_records

    displacements, forces = zip(*robot.actuator_units, strict=True)
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
    meta = {"rows": list(robot.rows.names), "rest_e": robot.rest_e.tolist(), "length": robot.length, "units": units}
    write_records(path, records, meta)
