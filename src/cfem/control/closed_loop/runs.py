"""One controller of a loop along one reference, for every seed: rows of the table, and what they come to."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from cfem.condensed.far import far_of
from cfem.control.closed_loop.account import over_time, saturation
from cfem.control.closed_loop.controllers import at_the_end, controller_of, known
from cfem.control.closed_loop.estimated_account import EstimateAccount, estimate_results
from cfem.control.closed_loop.pilots import (
    Situation,
    bounded,
    gains_of,
    model_of,
    moving_model,
    pilot_of,
    seeds_of,
    standing_at,
)
from cfem.control.closed_loop.plants import PlantOf, push_of
from cfem.control.closed_loop.reference import Reference
from cfem.control.closed_loop.run import Moment, run_closed_loop
from cfem.control.closed_loop.run_spec import ClosedLoopSpec
from cfem.control.closed_loop.spec import ControllerSpec, LoopSpec
from cfem.control.closed_loop.summary import record, summarise
from cfem.control.closed_loop.tick import Pilot
from cfem.equilibrium.system.robot import Robot
from cfem.motion.model import MotionModel
from cfem.plant.gains import Gains, stable_below
from cfem.predict.protocol import Predictor


@dataclass(frozen=True)
class Setting:
    """What all controllers and references of a run share.

    spec, base: of the run, and its folder
    robot, predictors, motions: the robot, its models, and what they have learned of motion, by name
    plant_of: makes the plant for a seed
    pilot: how goals are searched for without a clock
    n_parameters: columns of parameters in the table, 0 where no controller adapts"""

    spec: ClosedLoopSpec
    base: Path
    robot: Robot
    predictors: Mapping[str, Predictor]
    motions: Mapping[str, MotionModel]
    plant_of: PlantOf
    pilot: Pilot
    n_parameters: int

    def situation(self, reference: Reference) -> Situation:
        """Facts that the controllers know before the first tick."""
        loop, robot, start = self.spec.loop, self.robot, None
        if loop.moving or loop.laps:
            standing = replace(self.pilot, limits=bounded(self.pilot.limits, loop))
            start = standing_at(reference.goals[0], standing, robot.rest_e)
        far = far_of(robot.rows, robot.length)
        return Situation(loop, robot.rest_e, robot.reach, robot.length, far, start)

    def controller(self, spec: ControllerSpec, pilot: Pilot, gains: Gains | None, situation: Situation) -> Any:
        """A controller at its start."""
        motion = self.motions.get(moving_model(spec, self.predictors))
        return controller_of(spec, pilot, gains, motion, situation, self.base, self.predictors)


def run_controller(
    setting: Setting,
    situation: Situation,
    reference: Reference,
    name: str,
    write: Callable[[dict[str, Any]], None],
    advance: Callable[[int], None],
) -> dict[str, Any]:
    """Results of one controller along one reference, all seeds; write: takes a row of the table, advance: counts goals
    of the progress."""
    loop, robot = setting.spec.loop, setting.robot
    spec = loop.controllers[name]
    model, gains = model_of(spec, setting.predictors, robot), gains_of(spec)
    pilot = pilot_of(setting.pilot, spec, loop, model, robot)
    runs, rows, parameters, controller, account = [], [], [], None, None
    losses: list[dict[str, int]] = []  # by seed, of a plant at the other end of a wire
    for seed in seeds_of(spec, loop):
        controller = setting.controller(spec, pilot, gains, situation)
        count, account = _Counter(advance), _account(loop, controller, robot)

        def after(moment: Moment, seed=seed, controller=controller, count=count, account=account) -> None:
            """Writes a row of the table."""
            count(moment.index)
            row = record(reference.name, name, seed, loop.rate, moment) | known(controller, setting.n_parameters)
            if account:
                row |= account.row(controller, moment.tick, moment.actual)
            if loop.live:
                row["models_taken"] = _models_taken_up(setting.predictors)
            rows.append(row)
            write(row)

        with setting.plant_of(seed) as plant:
            if loop.moving:
                plant.settle(controller.belief.u, pilot.command)
            runs.append(
                run_closed_loop(
                    reference.goals, pilot, plant, robot.rest_e, reference.pace, after=after, controller=controller
                )
            )
        if lost := getattr(plant, "losses", None):
            losses.append(lost)
        parameters.append(known(controller, setting.n_parameters))
    return {
        "gains": gains and {"proportional": gains.proportional, "integral": controller.feedback.integral},
        **unstable(gains, controller),
        **summarise(runs, len(reference.goals), reference.pace, loop.rate),
        "over_time": over_time(runs, loop.rate),
        "saturated": saturation(runs, pilot, robot.rows.actuators),
        **at_the_end(parameters, model, spec),
        **({"losses": losses} if losses else {}),
        **({} if account is None else {"estimate": estimate_results(rows, account.unknowns)}),
    }


def unstable(gains: Gains | None, controller: Any) -> dict[str, Any]:
    """The bound of the stated integral gain, and how late samples came, where the gain is beyond it."""
    if gains is None or gains.integral is None or gains.proportional:
        return {}
    late = controller.feedback.late
    if gains.integral < stable_below(late):
        return {}
    return {"unstable": {"integral": gains.integral, "stable_below": stable_below(late), "late": late}}


def _models_taken_up(predictors: Mapping[str, Any]) -> int:
    """Number of models that have been taken up, one of this moment included."""
    for model in predictors.values():
        model.refresh()
    return sum(model.taken for model in predictors.values())


def _account(loop: LoopSpec, controller: Any, robot: Robot) -> EstimateAccount | None:
    """Comparison of estimates with the truth, None where nothing is estimated."""
    if loop.estimate is None:
        return None
    push, since = push_of(loop, robot)
    return EstimateAccount(controller.estimator, push, since)


class _Counter:
    """Advances the progress by a goal when the loop has gone on to it."""

    def __init__(self, advance: Callable[[int], None]):
        self._advance, self._seen = advance, -1

    def __call__(self, index: int) -> None:
        if index > self._seen:
            self._seen = index
            self._advance(1)
