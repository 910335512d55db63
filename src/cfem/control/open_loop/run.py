"""Every goal of a control run by every controller, carried out by the plant."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from cfem.control.closed_loop.controller import Controller
from cfem.control.goals.trajectory_spec import meant_beyond
from cfem.control.holding.spec import HoldingSpec
from cfem.control.open_loop.doubts import doubts
from cfem.control.open_loop.experiment import follow
from cfem.control.open_loop.mesh_error import discretisation, states_to_refine
from cfem.control.open_loop.planners import counted_rows, pilots_of
from cfem.control.open_loop.resume import SoFar
from cfem.control.open_loop.summary import headline, judged, record, summarise
from cfem.control.prepared import Prepared
from cfem.control.run_spec import FE_BASED, LoadedSpec, PlannedSpec
from cfem.core.artefact.judgement import KEY
from cfem.core.console.progress import progress
from cfem.dataset.writer import write_records


def carry_out(folder: Path, spec: PlannedSpec, base: Path, at: Prepared, so_far: SoFar) -> dict[str, Any]:
    """Writes trajectories.parquet and states.npz; returns the results. so_far: what an interrupted run has done."""
    holding = isinstance(spec, HoldingSpec)
    robot, fem = at.robot, at.fem
    surface, places = np.unique(robot.facets, return_inverse=True)
    so_far.of(at.plant, at.goals)
    done, total = so_far.done, sum(map(len, at.goals.values()))
    with progress("the robot carries out the commands", total, done=sum(done.goals.values())) as advance:
        for name in at.goals:
            if done.finished(name) < len(at.goals[name]):
                _follow(name, spec, at, surface, so_far, advance)
    so_far.restore()
    counted = counted_rows(spec, robot)
    results = {name: summarise(rows, robot.length, counted) for name, rows in done.rows.items()}
    records = [row for rows in done.rows.values() for row in rows]
    states = {"X": robot.X[surface], "facets": places.reshape(robot.facets.shape)}
    for name, shapes in done.shapes.items():
        states |= {
            f"{name}/index": np.array(sorted(shapes)),
            f"{name}/x": np.array([shapes[i] for i in sorted(shapes)]),
        }
    refined = discretisation(spec, at.scene, at.mesh, robot, (base / spec.scene).parent, done.solved)
    if holding:
        states["object_points"] = np.sum(surface >= len(robot.X) - robot.object_points)
    np.savez_compressed(folder / "states.npz", **states)
    _write_table(folder / "trajectories.parquet", records, at)
    costs = ("solves", "factorizations", "seconds")
    cost = {key: getattr(fem, key) for key in costs if hasattr(fem, key)} if fem else None
    lines, held, met = headline(results, refined, cost), None, None
    if isinstance(spec, LoadedSpec) and spec.loads:
        lines.append(f"estimated error of the models under the loads: {at.load_error:.2g} mm")
    if holding:
        held, said = _account(fem, at.touched)
        lines += said
    if at.world:
        figures, said = at.world.said(spec, records)
        lines = [*said, *lines]
        held, met = (held | figures, None) if holding else (None, figures)
    if at.touched and at.touched.commands:  # none where the model is its own plant
        lines.append(at.touched.sentence())
    so_far.remove()
    return {
        "headline": lines,
        KEY: [
            *judged(results, {name: meant_beyond(trajectory) for name, trajectory in spec.trajectories.items()}),
            *doubts(at.goals, refined, robot.length),
            *(at.touched.judged(robot.length) if at.touched else []),
        ],
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
            f"object: forces and moments balance to {held['imbalance']:.1e} of their size in every glued state; "
            f"in its softest direction it is held with {held['softest']:.1e} of the stiffness of its stiffest"
        )
    if touched:
        held |= touched.account()
    return held, lines


def _follow(
    name: str, spec: PlannedSpec, at: Prepared, surface: np.ndarray, so_far: SoFar, advance: Callable[[int], None]
) -> None:
    """The goals of one trajectory that are not done: their rows, and the deformed nodes of the surface at them."""
    done, goals = so_far.done, at.goals[name]
    begun = done.finished(name)
    if not begun:
        so_far.restore()
        if isinstance(spec, HoldingSpec) and at.touched:
            at.touched.reset()  # friction depends on the way, and plans begin at rest
    pilots = pilots_of(spec, at.robot, at.predictors, at.fem, at.world)
    judge = Controller(pilots[FE_BASED], at.rest_e) if FE_BASED in pilots else None
    so_far.restore(judge)
    wanted = states_to_refine(at.goals, spec, at.robot.rest_e)
    chosen = set(np.linspace(0, len(goals) - 1, min(spec.pictures, len(goals))).round().astype(int).tolist())
    rows = done.rows.setdefault(name, [])

    def after(index: int) -> None:
        advance(1)
        if (name, index) in wanted and at.plant.state is not None:
            done.solved.append(at.plant.state)
        if at.fem and index in chosen:
            done.shapes.setdefault(name, {})[index] = at.plant.x[surface].astype(np.float32)

    let_go = getattr(spec.trajectories[name], "let_go", False)
    by = (FE_BASED, judge) if judge else None
    for tracked in follow(goals, pilots, at.plant, at.rest_e, by, after, let_go, begun):
        fe = next((one for one in tracked if one.controller == FE_BASED), None)
        rows += [record(name, one, spec.reached, fe, at.world, spec.reached_rotation) for one in tracked]
        so_far.finished(name, judge)


def _write_table(path: Path, records: list[dict], at: Prepared) -> None:
    displacements, forces = zip(*at.robot.actuator_units, strict=True)
    units = {
        "error": "mm",
        "goal": "mm",
        "x_e": "mm",
        "delta_a": displacements,
        "lambda_a": forces,
        "contact": "N",
        "predicted_e": "mm",
        "rotation_error": "deg",
        "step_us": "us",
        "seconds": "s",
    }
    rows = (at.world or at.robot).rows.names
    meta = {"rows": list(rows), "rest_e": at.rest_e.tolist(), "length": at.robot.length, "units": units}
    write_records(path, records, meta)
