"""The `loop:` part of `cfem control`: every controller along every trajectory, into the plant that the spec says."""

from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cfem.condensed.model import Model
from cfem.control.closed_loop import Moment, Pace, run_loop
from cfem.control.closed_loop_spec import ControllerSpec, LoopSpec
from cfem.control.closed_loop_summary import headline, judged, record, summarise
from cfem.control.estimated_account import EstimateAccount, estimate_results
from cfem.control.inverse import Limits
from cfem.control.loop_controllers import at_the_end, controller_of, known, parameters_of
from cfem.control.loop_plants import plants_of, push_of
from cfem.control.moving.account import over_time, saturation
from cfem.control.moving.built import Situation, standing_at
from cfem.control.moving.laps import laps
from cfem.control.spec import FE_BASED, ControlSpec
from cfem.control.tick import Pilot
from cfem.control.tick_log import tick_log
from cfem.control.trajectory_spec import meant_beyond
from cfem.core.judgement import KEY
from cfem.core.progress import progress
from cfem.equilibrium.robot import Robot
from cfem.motion.load import load_motion
from cfem.motion.model import MotionModel
from cfem.plant.gains import PHASE_MARGIN, Gains
from cfem.predict.protocol import Predictor


def run_controllers(
    folder: Path,
    spec: ControlSpec,
    base: Path,
    robot: Robot,
    predictors: Mapping[str, Predictor],
    goals: Mapping[str, np.ndarray],
    pilot: Pilot,
) -> dict[str, Any]:
    """Writes loop.parquet, a row a tick; returns the results. Ticks of a device are on disk as they come (`tick_log`).
    goals: (m, n_e) mm absolute by trajectory; pilot: how goals are searched for; base: folder of the spec, where a
    device starts. InputError where that fails."""
    loop, dt = spec.loop, 1 / spec.loop.rate
    motions, standing = _motions(spec, base, predictors), replace(pilot, limits=_bounded(pilot.limits, spec.loop))
    plant_of = plants_of(spec, base, robot, predictors, motions)
    records, results, run_ups, adapting = [], {}, {}, parameters_of(loop, predictors)
    if loop.laps:
        run, goals = loop.laps, dict(goals)
        for name in list(goals):
            points = goals.pop(name)
            for speed in run.speeds:
                at = f"{name} at {speed:g} Hz"
                goals[at], run_ups[at] = laps(points, speed, run.laps, run.run_up, dt)
    log = tick_log(folder) if spec.plant == "pipe" else nullcontext(lambda row: None)
    with progress("goals of all controllers and seeds", _visits(goals, loop)) as advance, log as append:
        for trajectory, points in goals.items():
            results[trajectory] = {}
            pace = _pace(loop, run_ups.get(trajectory, 0))
            stands = loop.moving or loop.laps
            start = standing_at(points[0], standing, robot.rest_e) if stands else None
            at = Situation(loop, robot.rest_e, robot.reach, robot.length, start)
            for name, controller in loop.controllers.items():
                model, gains = _model(controller, predictors, robot), _gains(controller)
                flown = _flown(pilot, controller, loop, model, robot)
                runs, ended = [], []
                for seed in _seeds(controller, loop):
                    tell, count = partial(record, trajectory, name, seed, loop.rate), _Counter(advance)
                    motion = motions.get(_name(controller, predictors))
                    told = controller_of(controller, flown, gains, motion, at, base, predictors)
                    account = _account(loop, told, robot)

                    def after(one: Moment, tell=tell, count=count, told=told, account=account) -> None:
                        count(one.index)
                        estimated = account.row(told, one.tick, one.actual) if account else {}
                        records.append(tell(one) | known(told, adapting) | estimated)
                        if loop.live:
                            records[-1]["models_taken"] = _taken(predictors)
                        append(records[-1])

                    with plant_of(seed) as plant:
                        if loop.moving:
                            plant.settle(told.belief.u, flown.command)
                        runs.append(run_loop(points, flown, plant, robot.rest_e, pace, after=after, controller=told))
                    ended.append(known(told, adapting))
                results[trajectory][name] = {
                    "gains": gains and {"proportional": gains.proportional, "integral": told.feedback.integral},
                    **summarise(runs, len(points), pace, loop.rate),
                    "over_time": over_time(runs, loop.rate),
                    "saturated": saturation(runs, flown, robot.rows.actuators),
                    **at_the_end(ended, model, controller),
                    **_estimates(records, trajectory, name, account),
                }
        _write(folder / "loop.parquet", records, robot, loop)
    # Laps run on whether a goal is reached or not.
    counted = {} if loop.laps else {name: results[name] for name in goals if not meant_beyond(spec.trajectories[name])}
    said = {"headline": headline(results), KEY: judged(counted)}
    return {**said, "plant": spec.plant, "loop": results, "length": robot.length}


def _taken(predictors: Mapping[str, Any]) -> int:
    """How many models have been taken up, one of this moment included."""
    for one in predictors.values():
        one.refresh()
    return sum(one.taken for one in predictors.values())


def _account(loop: LoopSpec, told: Any, robot: Robot) -> EstimateAccount | None:
    if loop.estimate is None:
        return None
    push, since = push_of(loop, robot)
    return EstimateAccount(told.estimator, push, since)


def _estimates(
    records: list[dict[str, Any]], trajectory: str, name: str, account: EstimateAccount | None
) -> dict[str, Any]:
    if account is None:
        return {}
    mine = [one for one in records if (one["trajectory"], one["controller"]) == (trajectory, name)]
    return {"estimate": estimate_results(mine, account.unknowns)}


def _name(controller: ControllerSpec, predictors: Mapping[str, Predictor]) -> str:
    """Of the model that knows how it moves."""
    return controller.model if controller.model in predictors else next(iter(predictors))


def _motions(spec: ControlSpec, base: Path, predictors: Mapping[str, Predictor]) -> dict[str, MotionModel]:
    """What has learned to move, of the models that are asked how. InputError where one has not."""
    controllers = spec.loop.controllers.values()
    wanted = {_name(one, predictors) for one in controllers if one.moves or spec.loop.estimates_motion}
    if spec.plant == "model" and spec.loop.moving:
        wanted.add(next(iter(predictors)))
    return {name: load_motion(base / spec.models[name]) for name in sorted(wanted)}


def _visits(goals: Mapping[str, np.ndarray], loop: LoopSpec) -> int:
    return sum(map(len, goals.values())) * sum(len(_seeds(one, loop)) for one in loop.controllers.values())


class _Counter:
    """Advances the progress by a goal when the loop has gone on to it."""

    def __init__(self, advance: Callable[[int], None]):
        self._advance, self._seen = advance, -1

    def __call__(self, index: int) -> None:
        if index > self._seen:
            self._seen = index
            self._advance(1)


def _seeds(controller: ControllerSpec, loop: LoopSpec) -> list[int]:
    """The first alone where nothing that is measured changes a command."""
    deaf = controller.mode == "open" and controller.observer != "measured"
    return loop.seeds[:1] if deaf else loop.seeds


def _model(controller: ControllerSpec, predictors: Mapping[str, Predictor], robot: Robot) -> Model:
    """The controller's own: an FE model remembers where it has been."""
    if controller.model == FE_BASED:
        from cfem.plant.fem_plant import FemPlant

        return FemPlant(robot)
    return predictors[controller.model or next(iter(predictors))]


def _flown(search: Pilot, controller: ControllerSpec, loop: LoopSpec, model: Model, robot: Robot) -> Pilot:
    """search: how goals are searched for without a clock."""
    command, limits = loop.command, _bounded(search.limits, loop)
    if command.kind == "force" and robot.forces is not None:
        # What protects the robot is the bound of what it is told; a course only has to be one that the model knows.
        limits = Limits(limits.lambda_a, _known_course(model, robot))
    return replace(
        search,
        model=model,
        command=command.kind,
        observer=controller.observer,
        limits=limits,
        settings=replace(search.settings, iterations=controller.iterations),
        restarts=0,
        rate=np.inf if command.step is None else command.step,
    )


def _bounded(limits: Limits, loop: LoopSpec) -> Limits:
    command = loop.command
    if command.kind == "displacement" or command.largest is None:
        return limits
    return replace(limits, lambda_a=np.clip(limits.lambda_a, -command.largest, command.largest))


def _known_course(model: Model, robot: Robot) -> np.ndarray:
    """(n_a, 2) mm (mm^3): what the scene states, and wherever else the model was trained; unbounded for FE."""
    if not hasattr(model, "domain"):
        return np.full_like(robot.reach, np.inf) * [-1, 1]
    low, high = np.stack([robot.reach, model.domain.delta_a.T], axis=-1).swapaxes(0, 1)
    return np.column_stack([low.min(axis=-1), high.max(axis=-1)])


def _gains(controller: ControllerSpec) -> Gains | None:
    if controller.mode != "closed" or controller.mpc is not None:
        return None
    spec = controller.gains
    bound = np.inf if spec is None or spec.bound is None else spec.bound
    if spec is not None and spec.integral is not None:
        return Gains(spec.proportional, spec.integral, bound)
    return Gains(bound=bound, phase_margin=PHASE_MARGIN if spec is None else spec.phase_margin)


def _pace(loop: LoopSpec, run_up: int) -> Pace:
    if loop.laps:
        return Pace(loop.settle.radius, 1, 1, run_up=run_up)
    return Pace(
        loop.settle.radius,
        loop.ticks(loop.settle.hold),
        None if loop.goal_every is None else loop.ticks(loop.goal_every),
        loop.ticks(loop.settle.at_most),
        None if loop.budget is None else loop.ticks(loop.budget),
        0 if loop.goal_every is None else loop.ticks(loop.approach),
    )


def _write(path: Path, records: list[dict[str, Any]], robot: Robot, loop: LoopSpec) -> None:
    from cfem.dataset.writer import write_records

    units = dict.fromkeys(("goal", "aimed", "x_e", "measured_e", "error"), "mm") | {"seconds": "s", "step_us": "us"}
    meta = {"rows": list(robot.rows.names), "rest_e": robot.rest_e.tolist(), "units": units}
    if loop.estimate is not None:
        shown, (displacement, _) = ("estimated_a", "estimated_a_sd", "true_a"), robot.actuator_units[0]
        units |= dict.fromkeys(("estimated_e", "shape_rms", "shape_max"), "mm") | dict.fromkeys(shown, displacement)
        units |= dict.fromkeys(("loads", "loads_sd", "true_loads"), "N")
        meta["loaded"] = list(loop.estimate.loads.rows) if loop.estimate.loads else []
    write_records(path, records, meta)
