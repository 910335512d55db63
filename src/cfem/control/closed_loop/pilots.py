"""Setting of a controller of a loop, from its spec: model, limits, gains, seeds, and where the robot stands."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from cfem.condensed import Condensed
from cfem.condensed.model import Model
from cfem.control.closed_loop.spec import ControllerSpec, LoopSpec
from cfem.control.closed_loop.tick import Pilot
from cfem.control.search.goal_search import Iterate, search_goal
from cfem.control.search.inverse import Aim, Limits
from cfem.control.task.run_spec import FE_BASED
from cfem.core.errors import SpecError
from cfem.equilibrium.system.robot import Robot
from cfem.plant.gains import PHASE_MARGIN, Gains
from cfem.predict.protocol import Predictor


@dataclass(frozen=True)
class Situation:
    """Facts that all controllers of a run share.

    loop: the spec
    rest_e: (n_e,) mm
    reach: (n_a, 2) mm
    length: mm
    far: (n_e,) mm from rest, beyond which a goal or a sample is in another unit
    start: where the robot stands before the first tick, None: at rest"""

    loop: LoopSpec
    rest_e: np.ndarray
    reach: np.ndarray
    length: float
    far: np.ndarray
    start: Condensed | None


def moving_model(controller: ControllerSpec, predictors: Mapping[str, Predictor]) -> str:
    """Name of the model that knows how the robot moves."""
    return controller.model if controller.model in predictors else next(iter(predictors))


def seeds_of(controller: ControllerSpec, loop: LoopSpec) -> list[int]:
    """Seeds of the noise; the first alone where nothing that is measured changes a command."""
    deaf = controller.mode == "open" and controller.observer != "measured"
    return loop.seeds[:1] if deaf else loop.seeds


def model_of(controller: ControllerSpec, predictors: Mapping[str, Predictor], robot: Robot) -> Model:
    """The model of a controller. One of finite elements is its own: it remembers where it has been."""
    if controller.model == FE_BASED:
        from cfem.plant.fem_plant import FemPlant

        return FemPlant(robot)
    return predictors[controller.model or next(iter(predictors))]


def pilot_of(search: Pilot, controller: ControllerSpec, loop: LoopSpec, model: Model, robot: Robot) -> Pilot:
    """The pilot of a controller; search: how goals are searched for without a clock."""
    command, limits = loop.command, bounded(search.limits, loop)
    if command.kind == "force" and robot.forces is not None:
        # What protects the robot is the bound of what it is told; a course only has to be one that the model knows.
        anywhere = np.tile([-np.inf, np.inf], (len(robot.reach), 1))
        course = anywhere if controller.model == FE_BASED else _known(model, robot)
        limits = Limits(limits.lambda_a, course)
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


def bounded(limits: Limits, loop: LoopSpec) -> Limits:
    """The limits, with forces no larger than the largest command."""
    command = loop.command
    if command.kind == "displacement" or command.largest is None:
        return limits
    return replace(limits, lambda_a=np.clip(limits.lambda_a, -command.largest, command.largest))


def _known(model: Predictor, robot: Robot) -> np.ndarray:
    """Courses (n_a, 2) mm (mm^3) that the model knows: those of the scene, and wherever else it was trained."""
    (low, high), reach = model.domain.delta_a, robot.reach
    return np.column_stack([np.minimum(low, reach[:, 0]), np.maximum(high, reach[:, 1])])


def gains_of(controller: ControllerSpec) -> Gains | None:
    """Gains of the correction, None where a controller has none."""
    if controller.mode != "closed" or controller.mpc is not None:
        return None
    spec = controller.gains
    bound = np.inf if spec is None or spec.bound is None else spec.bound
    if spec is not None and spec.integral is not None:
        return Gains(spec.proportional, spec.integral, bound)
    return Gains(bound=bound, phase_margin=PHASE_MARGIN if spec is None else spec.phase_margin)


def standing_at(goal: np.ndarray, search: Pilot, rest_e: np.ndarray) -> Condensed:
    """State of the static model nearest to a goal (n_e,) mm absolute. SpecError where it finds no way there."""
    aim = Aim(goal - rest_e, search.weights, search.ridge, search.preload, search.damping)
    home = getattr(search.model, "home", np.zeros(len(search.ridge)))
    settings = replace(search.settings, iterations=max(search.settings.iterations, 20))
    result = search_goal(search.model, aim, search.limits, Iterate.at(search.model.at_displacement(home)), settings)
    if not np.isfinite(result.distance):
        raise SpecError(f"no way to the first goal is found: {result.status.value}", where="trajectories")
    return result.iterate.condensed
