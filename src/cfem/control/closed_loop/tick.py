"""One tick of embedded control, after the paper's Algorithm 2: where the actuators stand, the condensed model there,
an inverse step or a few towards the goal, a command within its limits.

Where no sensor says where the actuators stand, an observer does. `equilibrium` solves grad Psi(delta_a) = lambda_a,
which a model of the forces answers at once and one of the displacements in a few Newton steps, W_aa being the inverse
of the Hessian of Psi. The paper's `previous_step` takes delta_a = W_aa lambda_a + delta_free_a of the linearisation
before, whose error is second order in the step."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from cfem.condensed.model import Model, under_force
from cfem.control.search.goal_search import (
    Iterate,
    Place,
    SearchResult,
    SearchSettings,
    SearchStatus,
    by_displacement,
    by_force,
    search_goal,
)
from cfem.control.search.inverse import Aim, Limits, inverse_step
from cfem.control.search.multistart import all_over, around, multistart
from cfem.control.search.optimality import Verdict
from cfem.core.errors import InputError, NumericalError
from cfem.plant.protocol import Command, Measurement

Observer = Literal["measured", "previous_step", "equilibrium"]
ONCE = SearchSettings(iterations=1)
TRACKING = "tracking"  # of a tick that used its inverse steps, as it should
STOPPED = "the search stopped where the effectors could come nearer: its tolerance or regularisation is too large"


# Search for a goal, with the arguments of `search_goal`.
GoalSearch = Callable[[Model, Aim, Limits, Iterate, SearchSettings, Place], SearchResult]
# Search for actuations that put an object down at a goal and let it go.
PutDown = Callable[[Model, Aim, Limits, Iterate, SearchSettings], SearchResult]


@dataclass(frozen=True)
class Pilot:
    """What turns goals into commands.

    model: answers for the robot
    command: what the drives take
    observer: how it is known where the actuators stand
    limits: amplitudes
    weights (n_e,), ridge (n_a,), preload, damping, places: see `Aim`
    settings: of the search in a tick; 1 iteration is the paper's
    rate: mm (mm^3) or N (MPa) by which a command may change in a tick, one number for all or (n_a,)
    approach: settings of the first tick, whose goal may be far away; None: as those of the others
    restarts: places all over the reach from which a goal that was missed is searched for again
    search: for a goal
    put_down: for a goal at which robots let their object go, None without an object"""

    model: Model
    command: Command
    observer: Observer
    limits: Limits
    weights: np.ndarray
    ridge: np.ndarray
    settings: SearchSettings = ONCE
    rate: np.ndarray | float = np.inf
    preload: np.ndarray | float = 0.0
    damping: np.ndarray | None = None
    approach: SearchSettings | None = None
    places: np.ndarray | None = None
    restarts: int = 0
    search: GoalSearch = search_goal
    put_down: PutDown | None = None


@dataclass(frozen=True)
class Belief:
    """What the controller knows after a tick.

    iterate: the model where it takes the actuators to stand
    u: (n_a,) the command
    status: 'tracking' on the way, 'converged' at the goal, 'out of reach' at the nearest point, or what went wrong
    plan: the search itself, None where the published step was taken or the model had no answer
    rejected: the sample of this tick corrected nothing, or not the parameters that adapt: it is in another unit, too
    old, or a jump nobody confirmed"""

    iterate: Iterate
    u: np.ndarray
    status: str
    plan: SearchResult | None = None
    rejected: bool = False

    @property
    def delta_a(self) -> np.ndarray:
        """Displacements (n_a,) mm of the actuators that the controller believes in."""
        return self.iterate.condensed.delta_a

    @classmethod
    def at(cls, pilot: Pilot, delta_a: np.ndarray) -> "Belief":
        """Belief before the first tick, the robot standing at delta_a (n_a,) mm."""
        condensed = pilot.model.at_displacement(delta_a)
        u = condensed.delta_a if pilot.command == "displacement" else condensed.lambda_a
        return cls(Iterate.at(condensed), u, SearchStatus.CONVERGED.value)


@dataclass(frozen=True)
class MovingBelief:
    """Belief of a controller that knows how the robot moves, after a tick.

    u: (n_a,) the command
    status: 'converged' or why not
    delta_a: (n_a,) mm where it takes the actuators to be at its end
    softened: it could not keep what the robot does within bounds
    astray: the last sample is far beyond what its observer expected
    rejected: the sample of this tick does not fit, and corrected nothing
    restarted: too many did not fit, and the observer began again"""

    u: np.ndarray
    status: str
    delta_a: np.ndarray
    softened: bool = False
    astray: bool = False
    rejected: bool = False
    restarted: bool = False


def drive(
    pilot: Pilot, belief: Belief, goal: np.ndarray, measured: Measurement | None = None, let_go: bool = False
) -> Belief:
    """Belief after one tick towards goal (n_e,) mm from rest; measured: the latest, for the observer that needs it;
    let_go: robots put their object down there and open. Where the model has no answer the command stays, and the status
    says why. InputError where that observer's sensor is missing."""
    aim = Aim(goal, pilot.weights, pilot.ridge, pilot.preload, pilot.damping, pilot.places)
    limits = _tick_limits(pilot, belief.u)
    try:
        iterate = belief.iterate
        if pilot.observer == "measured" and measured is not None:
            iterate = _at_measured(pilot, iterate, measured)
        if pilot.command == "force" and pilot.observer == "previous_step":
            return _published_step(pilot, iterate, aim, limits)
        if let_go:
            if pilot.put_down is None:
                raise InputError("the robots hold no object that they could let go", do="leave let_go out")
            return _within(pilot, pilot.put_down(pilot.model, aim, limits, iterate, pilot.settings), limits)
        # Steps in what the model is a function of: it then gives the other half of a state for nothing.
        forces = pilot.command == "force" and getattr(pilot.model, "form", "displacement") == "force"
        place = by_force if forces else by_displacement
        result = pilot.search(pilot.model, aim, limits, iterate, pilot.settings, place)
        if result.status is SearchStatus.QP_FAILED:
            return replace(belief, status=result.status.value, plan=result)
        kinked = getattr(pilot.model, "kinked", False)
        if kinked or pilot.restarts:
            starts = around(result, limits) if kinked else all_over(pilot.model, limits, pilot.restarts)
            place = by_displacement if kinked else place
            result = multistart(pilot.model, aim, limits, result, pilot.settings, place, starts)
        # Whether a goal is out of reach is a matter of the robot, not of what one tick may change.
        return _within(pilot, replace(result, limits=pilot.limits, tried=kinked), limits)
    except NumericalError as error:
        return replace(belief, status=str(error), plan=SearchResult.stays(aim, pilot.limits, belief.iterate))


def _within(pilot: Pilot, result: SearchResult, limits: Limits) -> Belief:
    """Belief with the command that leads to what was found, cut down to its limits, and where that leads."""
    if pilot.command == "displacement":
        return Belief(result.iterate, np.clip(result.delta_a, *limits.delta_a.T), _status(result, limits), result)
    iterate, u = result.iterate, np.clip(result.lambda_a, *limits.lambda_a.T)
    if not np.array_equal(u, result.lambda_a):
        iterate = replace(iterate, condensed=under_force(pilot.model, u, iterate.condensed))
    return Belief(iterate, u, _status(result, limits), result)


def _status(result: SearchResult, limits: Limits) -> str:
    """Status of a belief after a search; limits: of this tick."""
    if result.status not in (SearchStatus.CONVERGED, SearchStatus.NO_DESCENT):
        return TRACKING if result.status is SearchStatus.ITERATIONS else result.status.value
    verdict = result.verdict()
    if verdict is not Verdict.NOT_CONVERGED:
        return SearchStatus.CONVERGED.value if verdict is Verdict.REACHED else verdict.value
    if result.status is SearchStatus.NO_DESCENT:
        return result.status.value
    return STOPPED if _same(limits, result.limits) else TRACKING


def _same(a: Limits, b: Limits) -> bool:
    return a is b or (np.array_equal(a.delta_a, b.delta_a) and np.array_equal(a.lambda_a, b.lambda_a))


def _at_measured(pilot: Pilot, iterate: Iterate, measured: Measurement) -> Iterate:
    if measured.delta_a is None:
        raise InputError("the plant has no sensor of delta_a", do="choose another observer")
    if not np.isfinite(measured.delta_a).all():
        return iterate
    # A jump to what a sensor says teaches no curvature: it may be as short as rounding.
    return replace(iterate, condensed=pilot.model.at_displacement(measured.delta_a))


def _tick_limits(pilot: Pilot, u: np.ndarray) -> Limits:
    """Amplitudes, cut down to what a command that follows u may be."""
    if pilot.command == "displacement":
        return pilot.limits.within(u, pilot.rate)
    if np.all(pilot.rate == np.inf):
        return pilot.limits
    low, high = pilot.limits.lambda_a.T
    nearby = np.column_stack([np.clip(u - pilot.rate, low, high), np.clip(u + pilot.rate, low, high)])
    return replace(pilot.limits, lambda_a=nearby)


def _published_step(pilot: Pilot, iterate: Iterate, aim: Aim, limits: Limits) -> Belief:
    """Belief as published: the forces of the inverse step as they are, and its linearised displacements for where they
    lead."""
    for _ in range(pilot.settings.iterations):
        nearby = limits.within(iterate.condensed.delta_a, pilot.settings.step)
        step = inverse_step(iterate.condensed, aim, nearby, None, pilot.settings.backend)
        iterate = iterate.moved(pilot.model.at_displacement(step.delta_a))
    return Belief(iterate, np.clip(step.lambda_a, *limits.lambda_a.T), TRACKING)
