"""Control over time (`loop:` of control.yaml): every controller along every trajectory, in the plant that the spec
says."""

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np

from cfem.control.closed_loop.controllers import parameters_of
from cfem.control.closed_loop.pilots import moving_model, seeds_of
from cfem.control.closed_loop.plants import plants_of
from cfem.control.closed_loop.reference import Reference, references_of
from cfem.control.closed_loop.run_spec import ClosedLoopSpec
from cfem.control.closed_loop.runs import Setting, run_controller
from cfem.control.closed_loop.spec import LoopSpec
from cfem.control.closed_loop.summary import headline, judged
from cfem.control.closed_loop.tick import Pilot
from cfem.control.closed_loop.tick_log import tick_log
from cfem.control.task.goals.doubts import left_out, one_point, wide
from cfem.control.task.goals.from_spec import demand_near
from cfem.control.task.goals.trajectory_spec import meant_beyond
from cfem.control.task.loads import load_doubts
from cfem.core.artefact.judgement import KEY
from cfem.core.console.progress import progress
from cfem.equilibrium.system.robot import Robot
from cfem.motion.load import load_motion
from cfem.motion.model import MotionModel
from cfem.predict.protocol import Predictor


def run_controllers(
    folder: Path,
    spec: ClosedLoopSpec,
    base: Path,
    robot: Robot,
    predictors: Mapping[str, Predictor],
    goals: Mapping[str, np.ndarray],
    pilot: Pilot,
) -> dict[str, Any]:
    """Writes loop.parquet, a row a tick; returns the results. Ticks of a device are on disk as they come (`tick_log`).
    goals: (m, n_e) mm absolute by trajectory; pilot: how goals are searched for; base: folder of the spec, where a
    device starts. InputError where that fails. SpecError before the first tick where a goal is too far away, the robot
    cannot stand at the first one, or a controller has nothing to adapt."""
    loop, motions = spec.loop, _motions(spec, base, predictors)
    plant_of = plants_of(spec, base, robot, predictors, motions)
    setting = Setting(spec, base, robot, predictors, motions, plant_of, pilot, parameters_of(loop, predictors))
    references = references_of(goals, loop)
    for reference in references:
        demand_near(reference.name, reference.goals, robot)
    situations = {reference.name: setting.situation(reference) for reference in references}
    records, results = [], {}
    log = tick_log(folder) if spec.plant == "device" else nullcontext(lambda row: None)
    with progress("goals of all controllers and seeds", _visits(references, loop)) as advance, log as append:

        def write(row: dict[str, Any]) -> None:
            records.append(row)
            append(row)

        for reference in references:
            results[reference.name] = {
                name: run_controller(setting, situations[reference.name], reference, name, write, advance)
                for name in loop.controllers
            }
        _write(folder / "loop.parquet", records, robot, loop)
    # Laps run on whether a goal is reached or not.
    counted = {} if loop.laps else {name: results[name] for name in goals if not meant_beyond(spec.trajectories[name])}
    far = [] if loop.laps else wide(loop.settle.radius, robot.length, "loop.settle.radius")
    missing = [*left_out(goals, spec.trajectories), *one_point(goals, robot.length)]
    judgement = [*judged(counted), *missing, *far, *load_doubts(spec.loads)]
    verdict = {"headline": headline(results), KEY: judgement}
    return {**verdict, "plant": spec.plant, "loop": results, "length": robot.length}


def _motions(spec: ClosedLoopSpec, base: Path, predictors: Mapping[str, Predictor]) -> dict[str, MotionModel]:
    """Learned motions of the models that are asked for them. InputError where a model has not learned to move."""
    controllers = spec.loop.controllers.values()
    wanted = {moving_model(item, predictors) for item in controllers if item.moves or spec.loop.estimates_motion}
    if spec.plant == "model" and spec.loop.moving:
        wanted.add(next(iter(predictors)))
    return {name: load_motion(base / spec.models[name]) for name in sorted(wanted)}


def _visits(references: Sequence[Reference], loop: LoopSpec) -> int:
    """Goals of all references, controllers and seeds."""
    runs = sum(len(seeds_of(controller, loop)) for controller in loop.controllers.values())
    return runs * sum(len(reference.goals) for reference in references)


def _write(path: Path, records: list[dict[str, Any]], robot: Robot, loop: LoopSpec) -> None:
    """Writes the table of ticks with its units."""
    from cfem.dataset.writer import write_records

    units = dict.fromkeys(("goal", "aimed", "x_e", "measured_e", "error"), "mm") | {"seconds": "s", "step_us": "us"}
    meta = {"rows": list(robot.rows.names), "rest_e": robot.rest_e.tolist(), "units": units}
    if loop.estimate is not None:
        shown, (displacement, _) = ("estimated_a", "estimated_a_sd", "true_a"), robot.actuator_units[0]
        units |= dict.fromkeys(("estimated_e", "shape_rms", "shape_max"), "mm") | dict.fromkeys(shown, displacement)
        units |= dict.fromkeys(("loads", "loads_sd", "true_loads"), "N")
        meta["loaded"] = list(loop.estimate.loads.rows) if loop.estimate.loads else []
    write_records(path, records, meta)
