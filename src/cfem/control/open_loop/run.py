"""Every goal of a control run by every controller, carried out by the plant."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cfem.control.closed_loop.controller import Controller
from cfem.control.holding.gripping import Gripping
from cfem.control.holding.spec import HoldingSpec
from cfem.control.open_loop.doubts import doubts
from cfem.control.open_loop.experiment import follow
from cfem.control.open_loop.mesh_error import discretisation, states_to_refine
from cfem.control.open_loop.planners import counted_rows, pilots_of
from cfem.control.open_loop.resume import KeptRun
from cfem.control.open_loop.summary import headline, judged, record, summarise
from cfem.control.task.goals.doubts import left_out
from cfem.control.task.goals.trajectory_spec import has_been, meant_beyond
from cfem.control.task.loads import load_doubts
from cfem.control.task.obstacles.shorter_steps import StepDependence, step_dependence, step_dependence_of_grip
from cfem.control.task.obstacles.spec import ObstaclesSpec
from cfem.control.task.obstacles.stated import stated_errors
from cfem.control.task.prepared import Prepared
from cfem.control.task.run_spec import FE_BASED, LoadedSpec, PlannedSpec
from cfem.core.artefact.judgement import KEY
from cfem.core.console.progress import progress
from cfem.dataset.writer import write_records
from cfem.predict.contact.model import ContactModel


def carry_out(folder: Path, spec: PlannedSpec, base: Path, prepared: Prepared, kept_run: KeptRun) -> dict[str, Any]:
    """Writes trajectories.parquet and states.npz; returns the results. kept_run: what an interrupted run has done."""
    holding = isinstance(spec, HoldingSpec)
    robot, fem = prepared.robot, prepared.fem
    kept_run.begin([prepared.plant, *([] if fem in (None, prepared.plant) else [fem])], prepared.goals)
    done, total = kept_run.done, sum(map(len, prepared.goals.values()))
    with progress("the robot carries out the commands", total, done=sum(done.goals.values())) as advance:
        for name in prepared.goals:
            if done.finished(name) < len(prepared.goals[name]):
                _follow(name, spec, prepared, np.unique(robot.facets), kept_run, advance)
    kept_run.restore()
    counted = counted_rows(spec, robot)
    results = {name: summarise(rows, robot.length, counted) for name, rows in done.rows.items()}
    records = [row for rows in done.rows.values() for row in rows]
    refined = discretisation(spec, prepared.scene, prepared.mesh, robot, (base / spec.scene).parent, done.solved)
    _write_states(folder / "states.npz", robot, done.shapes, holding)
    _write_table(folder / "trajectories.parquet", records, prepared)
    cost = fem and {key: getattr(fem, key) for key in ("solves", "factorizations", "seconds")}
    lines, held, met = headline(results, refined, cost, spec.plant), None, None
    if isinstance(spec, LoadedSpec) and spec.loads:
        lines.append(f"estimated error of the models under the loads: {prepared.load_error:.2g} mm")
    if holding:
        held = prepared.touched.account()
    if prepared.world:
        figures, sentences = prepared.world.results(spec, records)
        lines = [*sentences, *lines]
        held, met = (held | figures, None) if holding else (None, figures)
    contact_error, steps = None, {}
    if isinstance(spec, ObstaclesSpec):
        contact_error, sentences = stated_errors(prepared.predictors, spec.error_places, records, prepared.rest_e)
        lines += sentences
    if prepared.world:
        steps = _depend_on_steps(prepared, records)
        lines += [dependence.sentence(name) for name, dependence in steps.items()]
    if prepared.touched and prepared.touched.commands:  # none where the model is its own plant
        lines.append(prepared.touched.sentence())
    kept_run.remove()
    return {
        "headline": lines,
        KEY: [
            *_judgement(spec, prepared, results, refined),
            *(finding for dependence in steps.values() for finding in dependence.judged(robot.length)),
        ],
        "object": held,
        "obstacles": met,
        "contact_error": contact_error,
        "shorter_steps": {name: dependence.results() for name, dependence in steps.items()},
        "load_error": prepared.load_error,
        "plant": spec.plant,
        "trajectories": results,
        "discretisation": refined,
        "length": robot.length,
        "fe_cost": cost,
        "nodes": len(robot.X),
    }


def _depend_on_steps(prepared: Prepared, records: Sequence[Mapping[str, Any]]) -> dict[str, StepDependence]:
    """Changes by shorter steps, by model, where friction makes the answers depend on them."""
    by_model = {}
    for name, model in prepared.predictors.items():
        rows = [row for row in records if row["controller"] == name]
        if isinstance(model, ContactModel):
            by_model[name] = step_dependence(model, rows)
        elif isinstance(model, Gripping):
            by_model[name] = step_dependence_of_grip(model, rows)
    return {name: dependence for name, dependence in by_model.items() if dependence}


def _judgement(
    spec: PlannedSpec, prepared: Prepared, results: dict[str, Any], refined: dict[str, Any]
) -> list[dict[str, Any]]:
    """Findings that make the run poor; results: of the trajectories; refined: of `mesh_error.discretisation`."""
    length = prepared.robot.length
    return [
        *judged(results, {name: meant_beyond(trajectory) for name, trajectory in spec.trajectories.items()}),
        *left_out(prepared.goals, spec.trajectories),
        *doubts(prepared.goals, spec.reached, refined, length),
        *(load_doubts(spec.loads) if isinstance(spec, LoadedSpec) else []),
        *(prepared.touched.judged(length) if prepared.touched else []),
    ]


def _follow(
    name: str,
    spec: PlannedSpec,
    prepared: Prepared,
    surface: np.ndarray,
    kept_run: KeptRun,
    advance: Callable[[int], None],
) -> None:
    """Carries out the goals of one trajectory that are not done: their rows, and the deformed nodes of the surface at
    them."""
    done, goals = kept_run.done, prepared.goals[name]
    begun = done.finished(name)
    if not begun:
        kept_run.restore()
        if isinstance(spec, HoldingSpec):
            prepared.touched.reset()  # friction depends on the way, and plans begin at rest
    pilots = pilots_of(spec, prepared.robot, prepared.predictors, prepared.fem, prepared.world)
    judge = Controller(pilots[FE_BASED], prepared.rest_e) if FE_BASED in pilots else None
    kept_run.restore(judge)
    wanted = states_to_refine(prepared.goals, spec, prepared.robot.rest_e)
    chosen = set(np.linspace(0, len(goals) - 1, min(spec.pictures, len(goals))).round().astype(int).tolist())
    rows = done.rows.setdefault(name, [])

    def after(index: int) -> None:
        advance(1)
        if (name, index) in wanted and prepared.plant.state is not None:
            done.solved.append(prepared.plant.state)
        if spec.plant == "fem" and index in chosen:
            done.shapes.setdefault(name, {})[index] = prepared.plant.x[surface].astype(np.float32)

    let_go = getattr(spec.trajectories[name], "let_go", False)
    judging = (FE_BASED, judge) if judge else None
    been_there = has_been(spec.trajectories[name]) and _free(spec, prepared)
    for tracked in follow(goals, pilots, prepared.plant, prepared.rest_e, judging, after, let_go, begun):
        fe = next((result for result in tracked if result.controller == FE_BASED), None)
        rows += [
            record(name, result, spec.reached, fe, prepared.world, spec.reached_rotation, been_there)
            for result in tracked
        ]
        kept_run.finished(name, judge)


def _free(spec: PlannedSpec, prepared: Prepared) -> bool:
    """True where nothing but the reach bounds a search, so that the robot's image is within its bounds."""
    return prepared.world is None and prepared.robot.forces is None and spec.search.largest_force is None


def _write_states(path: Path, robot: Any, shapes: Mapping[str, Mapping[int, np.ndarray]], holding: bool) -> None:
    """Writes the surface at rest, and its deformed nodes by trajectory and number of the goal."""
    surface, places = np.unique(robot.facets, return_inverse=True)
    states = {"X": robot.X[surface], "facets": places.reshape(robot.facets.shape)}
    for name, by_goal in shapes.items():
        states[f"{name}/index"] = np.array(sorted(by_goal))
        states[f"{name}/x"] = np.array([by_goal[i] for i in sorted(by_goal)])
    if holding:
        states["object_points"] = np.sum(surface >= len(robot.X) - robot.object_points)
    np.savez_compressed(path, **states)


def _write_table(path: Path, records: list[dict], prepared: Prepared) -> None:
    """Writes the table of goals with its units."""
    displacements, forces = zip(*prepared.robot.actuator_units, strict=True)
    units = {
        "error": "mm",
        "goal": "mm",
        "x_e": "mm",
        "delta_a": displacements,
        "lambda_a": forces,
        "contact": "N",
        "model_error": "mm",
        "force_error": "N",
        "predicted_e": "mm",
        "rotation_error": "deg",
        "step_us": "us",
        "seconds": "s",
    }
    rows = (prepared.world or prepared.robot).rows.names
    meta = {"rows": list(rows), "rest_e": prepared.rest_e.tolist(), "length": prepared.robot.length, "units": units}
    write_records(path, records, meta)
