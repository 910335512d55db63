"""Controllers of the `loop:` part as the spec has them, and what those that track parameters found for the table."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from cfem.condensed.model import Model
from cfem.control.adaptation.controller import AdaptiveController
from cfem.control.adaptation.tracker import Tracker
from cfem.control.closed_loop.estimated import EstimatingController, filter_of
from cfem.control.closed_loop.spec import ControllerSpec, LoopSpec
from cfem.control.closed_loop.tick import Pilot
from cfem.control.moving import built
from cfem.control.moving.built import Situation
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
    at: Situation,
    base: Path,
    predictors: Mapping[str, Predictor],
) -> Any:
    """As `moving.built.controller_of`, a policy (base: folder of the spec) or one that adapts; behind an estimator
    where the loop has one. SpecError where the model has no parameters to adapt, InputError where a policy is none of
    this robot or no model can tell what is estimated."""
    inner = _measuring(spec, pilot, gains, motion, at, base)
    if at.loop.estimate is None:
        return inner
    model = predictors.get(spec.model) or next(iter(predictors.values()))
    filtered = filter_of(at.loop, model, motion if at.loop.estimates_motion else None)
    return EstimatingController(inner, filtered, at.rest_e, pilot.command == "displacement", 1 / at.loop.rate)


def _measuring(
    spec: ControllerSpec, pilot: Pilot, gains: Gains | None, motion: MotionModel | None, at: Situation, base: Path
) -> Any:
    start = None if at.start is None else at.start.delta_a
    if spec.policy is not None:
        from cfem.control.closed_loop.policy import MovingPolicyController, PolicyController
        from cfem.gym.policy import Policy

        policy = Policy(base / spec.policy)
        if policy.moving:
            return MovingPolicyController(pilot, at.rest_e, policy, start, 1 / at.loop.rate)
        return PolicyController(pilot, at.rest_e, policy, start)
    if spec.adapt is None:
        return built.controller_of(spec, pilot, gains, motion, at)
    model, loop = pilot.model, at.loop
    camera = spec.adapt.camera
    if not isinstance(model, Predictor) or not (model.parameters or spec.adapt.loss or camera):
        do = "use a model that was sampled with parameters, or state a loss"
        raise SpecError("the controller's model has no parameters", where="loop.controllers.adapt", do=do)
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
    own = replace(pilot, model=AtParameters(model, tracker.used_p))
    return AdaptiveController(own, at.rest_e, tracker, gains, start)


def parameters_of(loop: LoopSpec, predictors: Mapping[str, Predictor]) -> int:
    """How many numbers `known` gives for a row of the table: 0 where no controller adapts."""
    adapting = [one for one in loop.controllers.values() if one.adapt is not None]
    sizes = [len(predictors[one.model or next(iter(predictors))].parameters) for one in adapting]
    return max(sizes, default=0)


def known(controller: Any, count: int) -> dict[str, Any]:
    """Columns of a row: parameters that the controller uses now, nan for one that tracks none."""
    if not count:
        return {}
    numbers, controller = np.full(count, np.nan), getattr(controller, "inner", controller)
    if isinstance(controller, AdaptiveController):
        numbers[: len(controller.tracker.used_p)] = controller.tracker.used_p
    return {"parameters": numbers}


def at_the_end(ended: Sequence[Mapping[str, Any]], model: Model, spec: ControllerSpec) -> dict[str, Any]:
    """Of the summary: each parameter at the end, the mean of the runs."""
    if spec.adapt is None or not ended or not ended[0]:
        return {}
    found = np.mean([one["parameters"] for one in ended], axis=0)
    return {"parameters": {one.name: float(value) for one, value in zip(model.parameters, found, strict=False)}}
