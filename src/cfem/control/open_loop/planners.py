"""Pilots that search for goals in a control run: by each model, with fewer iterations, and by FE matrices."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from cfem.condensed.coupling import Coupled
from cfem.condensed.strokes import FE_TOLERANCE, ridge_of, stated_or_share
from cfem.control.closed_loop.tick import Pilot
from cfem.control.holding.gripping import Gripping
from cfem.control.holding.spec import HoldingSpec
from cfem.control.search.goal_search import SearchSettings
from cfem.control.search.inverse import Limits
from cfem.control.search.multistart import RESTARTS
from cfem.control.task.obstacles.spec import ObstaclesSpec
from cfem.control.task.obstacles.world import ObstacleWorld
from cfem.control.task.run_spec import FE_BASED, PlannedSpec, TrackingSpec
from cfem.core.errors import SpecError
from cfem.predict.contact.model import ContactModel
from cfem.predict.protocol import Predictor


def pilot_of(spec: TrackingSpec, robot: Any, model: Any) -> Pilot:
    """Pilot that searches for goals with `model`, as the spec says."""
    search = spec.search
    return Pilot(
        model,
        "displacement",
        "equilibrium",
        _limits(spec, robot),
        weights_of(spec, robot),
        ridge_of(search.regularisation, robot.reach, robot.length),
        SearchSettings.of(
            robot.reach, search.iterations, search.tolerance, search.step, backend=search.qp, cautious=search.cautious
        ),
        preload=search.preload,
        damping=ridge_of(search.damping, robot.reach, robot.length) if search.damping else None,
        places=~np.array(robot.rows.turns),
        restarts=0 if isinstance(spec, HoldingSpec | ObstaclesSpec) or search.iterations == 1 else RESTARTS,
    )


def pilots_of(
    spec: PlannedSpec, robot: Any, predictors: Mapping[str, Predictor], fem: Any, world: ObstacleWorld | None = None
) -> dict[str, Pilot]:
    """Pilots of every controller of an open-loop run, by name: each model, the first one with fewer iterations, and FE
    matrices where the spec asks for them."""
    first, predictor = next(iter(predictors.items()))
    searched = pilot_of(spec, robot, predictor)
    if world:
        searched = world.pilot(searched)
        predictors = {name: _on_its_own_way(model) for name, model in predictors.items()}
    settings = searched.settings
    pilots = {name: replace(searched, model=model) for name, model in predictors.items()} | {
        f"{first}@{n}": replace(
            searched,
            model=_updated_once(predictor),
            settings=replace(settings, iterations=n),
            approach=settings,
            restarts=0,
        )
        for n in spec.fewer_iterations
    }
    if spec.fe_based:
        tolerance = stated_or_share(spec.fe_tolerance, FE_TOLERANCE, robot.reach)
        # Each restart would cost dozens of FE solves.
        pilots[FE_BASED] = replace(searched, model=fem, settings=replace(settings, tolerance=tolerance), restarts=0)
    return pilots


def _on_its_own_way(model: ContactModel | Gripping) -> ContactModel | Gripping:
    return model.standing(0.0) if isinstance(model, ContactModel) else replace(model, before=None, settled_at=None)


def _updated_once(model: Any) -> Any:
    """Model with one update of the object's pose at each inverse step, as the paper has it, where there is an
    object."""
    if isinstance(model, ContactModel):
        return _on_its_own_way(model)
    return Coupled(model.holds, model.object, model.home, 1) if isinstance(model, Coupled) else model


def _limits(spec: TrackingSpec, robot: Any) -> Limits:
    limits = Limits.of(robot.reach, robot.unilateral)
    if robot.forces is not None:
        limits = replace(limits, lambda_a=robot.forces)
    if spec.search.largest_force is None:
        return limits
    bound = spec.search.largest_force
    return replace(limits, lambda_a=np.clip(limits.lambda_a, -bound, bound))


def counted_rows(spec: TrackingSpec, robot: Any) -> list[str] | None:
    """Effector rows that distances to goals are of, where `search.weights` leave some of the others out."""
    counted = weights_of(spec, robot) > 0
    if counted[robot.aims].all():
        return None
    return [robot.rows.effectors[row] for row in np.flatnonzero(counted & robot.aims)]


def weights_of(spec: TrackingSpec, robot: Any) -> np.ndarray:
    """Weights (n_e,) of the effector rows, mm/rad for those of an object's rotation. SpecError where the spec states
    another number of them."""
    stated, weights = spec.search.weights, robot.aims.astype(float)
    if isinstance(spec, HoldingSpec):
        weights[:] = 1.0
    if stated is not None and len(stated) == robot.aims.sum():
        weights[robot.aims] = stated
    elif stated is not None:
        weights = np.array(stated)
    if len(weights) != robot.rows.n_e:
        raise SpecError(
            f"has {len(weights)} weights, and the robot {robot.rows.n_e} effector rows",
            where="search.weights",
            do="give one per row",
        )
    if isinstance(spec, HoldingSpec):
        weights[3:] *= robot.object_radius
    return weights
