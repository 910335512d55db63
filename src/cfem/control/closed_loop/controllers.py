"""Controllers of the `loop:` part as the spec has them, and what those that track parameters found for the table."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from cfem.condensed.model import Model
from cfem.control.adaptation.controller import AdaptiveController
from cfem.control.adaptation.tracker import Tracker
from cfem.control.closed_loop.estimated import EstimatingController, loop_filter
from cfem.control.closed_loop.pilots import Situation
from cfem.control.closed_loop.run import TickedController
from cfem.control.closed_loop.spec import ControllerSpec, LoopSpec
from cfem.control.closed_loop.tick import Pilot
from cfem.control.motion import built
from cfem.core.errors import SpecError
from cfem.motion.model import MotionModel
from cfem.plant.gains import Gains
from cfem.predict.at_parameters import AtParameters
from cfem.predict.protocol import Predictor


def controller_of(
    spec: ControllerSpec,
    pilot: Pilot,
    gains: Gains | None,
    motion: MotionModel | None,
    situation: Situation,
    base: Path,
    predictors: Mapping[str, Predictor],
) -> TickedController:
    """Controller of the spec: one of `moving.built`, a policy (base: folder of the spec) or one that adapts, behind an
    estimator where the loop has one. InputError where a policy is none of this robot or no model can tell what is
    estimated."""
    inner = _measuring(spec, pilot, gains, motion, situation, base)
    if situation.loop.estimate is None:
        return inner
    model = predictors.get(spec.model) or next(iter(predictors.values()))
    filtered = loop_filter(situation.loop, model, motion if situation.loop.estimates_motion else None)
    return EstimatingController(
        inner, filtered, situation.rest_e, pilot.command == "displacement", 1 / situation.loop.rate
    )


def _measuring(
    spec: ControllerSpec,
    pilot: Pilot,
    gains: Gains | None,
    motion: MotionModel | None,
    situation: Situation,
    base: Path,
) -> TickedController:
    """Controller without an estimator before it: a policy, one that adapts, or one of `moving.built`."""
    start = None if situation.start is None else situation.start.delta_a
    if spec.policy is not None:
        from cfem.control.closed_loop.policy import MovingPolicyController, PolicyController
        from cfem.gym.policy import Policy

        policy = Policy(base / spec.policy)
        if policy.moving:
            return MovingPolicyController(pilot, situation.rest_e, policy, start, 1 / situation.loop.rate)
        return PolicyController(pilot, situation.rest_e, policy, start)
    if spec.adapt is None:
        return built.controller_of(spec, pilot, gains, motion, situation)
    model, loop = pilot.model, situation.loop
    camera = spec.adapt.camera
    tracker = Tracker(
        model,
        loop.command.kind,
        spec.adapt.noise,
        None if spec.adapt.find is None else tuple(spec.adapt.find),
        float(spec.adapt.loss or 0.0),
        max(spec.adapt.forget * loop.rate / loop.ticks_a_sample, 2.0),
        pilot.weights > 0,
        (0.0, 0.0) if camera is None else (camera.shift, camera.turn),
    )
    bound = replace(pilot, model=AtParameters(model, tracker.used_p))
    return AdaptiveController(bound, situation.rest_e, tracker, gains, start, situation.far)


def parameters_of(loop: LoopSpec, predictors: Mapping[str, Predictor]) -> int:
    """Number of columns that `known` gives for a row of the table, 0 where no controller adapts. SpecError where one
    has nothing to adapt."""
    sizes = [0]
    for name, controller in loop.controllers.items():
        if (adapt := controller.adapt) is None:
            continue
        sizes.append(len(predictors[controller.model or next(iter(predictors))].parameters))
        if not (sizes[-1] or adapt.loss or adapt.camera):
            what, do = "its model has no parameters", "use a model that was sampled with parameters, or state a loss"
            raise SpecError(what, where=f"loop.controllers.{name}.adapt", do=do)
    return max(sizes)


def known(controller: TickedController, count: int) -> dict[str, Any]:
    """Columns of a row: parameters that the controller uses now, nan for one that tracks none."""
    if not count:
        return {}
    numbers = np.full(count, np.nan)
    controller = controller.inner if isinstance(controller, EstimatingController) else controller
    if isinstance(controller, AdaptiveController):
        numbers[: len(controller.tracker.used_p)] = controller.tracker.used_p
    return {"parameters": numbers}


def at_the_end(ended: Sequence[Mapping[str, Any]], model: Model, spec: ControllerSpec) -> dict[str, Any]:
    """Tracked parameters for the summary: the value of each at the end, the mean of the runs."""
    if spec.adapt is None or not ended or not ended[0]:
        return {}
    parameters = np.mean([ended_run["parameters"] for ended_run in ended], axis=0)
    return {
        "parameters": {
            parameter.name: float(value) for parameter, value in zip(model.parameters, parameters, strict=False)
        }
    }
