"""One tick of embedded control, after the paper's Algorithm 2: where the actuators stand, the condensed model there,
an inverse step or a few towards the goal, a command within its limits."""

from dataclasses import dataclass, replace

import numpy as np

from cfem.condensed import Condensed
from cfem.control.inverse import Aim, Limits, inverse_step
from cfem.control.loop import Iterate, Model, ReachStatus, Settings, by_displacement, reach
from cfem.control.observer import Observer, by_force
from cfem.control.plant import Command, Measurement
from cfem.control.qp import QpStatus, solve_qp
from cfem.core.errors import InputError, NumericalError

ONCE = Settings(iterations=1)
AT_BOUND = 1e-6  # of the larger of a bound and the distance to its opposite: nearer than that counts as held by it


@dataclass(frozen=True)
class Pilot:
    """What turns goals into commands. limits: amplitudes; rate: mm (mm^3) or N (MPa) by which a command may change in
    a tick; weights (n_e,), ridge (n_a,): see `Aim`; settings.iterations: inverse steps a tick, 1 is the paper's."""

    model: Model
    command: Command
    observer: Observer
    limits: Limits
    weights: np.ndarray
    ridge: np.ndarray
    settings: Settings = ONCE
    rate: float = np.inf


@dataclass(frozen=True)
class Belief:
    """What the controller knows after a tick. iterate: the model where it takes the actuators to stand; u: (n_a,) the
    command; limits: that held for it, of amplitude and rate; status: 'converged' or how the search ended."""

    iterate: Iterate
    u: np.ndarray
    limits: Limits
    status: str

    @classmethod
    def at(cls, pilot: Pilot, delta_a: np.ndarray) -> "Belief":
        """Before the first tick, the robot standing at delta_a (n_a,) mm."""
        condensed = pilot.model.at_displacement(delta_a)
        u = condensed.delta_a if pilot.command == "displacement" else condensed.lambda_a
        return cls(Iterate.at(condensed), u, pilot.limits, ReachStatus.CONVERGED.value)


def drive(pilot: Pilot, belief: Belief, goal: np.ndarray, measured: Measurement | None = None) -> Belief:
    """One tick towards goal (n_e,) mm from rest; measured: the latest, for the observer that needs it. Where the model
    has no answer the command stays, and the status says why. InputError where that observer's sensor is missing."""
    aim = Aim(goal, pilot.weights, pilot.ridge)
    limits = _this_tick(pilot, belief.u)
    try:
        at = belief.iterate
        if pilot.observer == "measured" and measured is not None:
            at = _seen(pilot, at, measured)
        if pilot.command == "force" and pilot.observer == "previous_step":
            return _as_published(pilot, at, aim, limits)
        place = by_displacement if pilot.command == "displacement" else by_force
        found = reach(pilot.model, aim, limits, at, pilot.settings, place)
    except NumericalError as error:
        return replace(belief, limits=limits, status=str(error))
    if found.status is ReachStatus.QP_FAILED:
        return replace(belief, limits=limits, status=found.status.value)
    if pilot.command == "displacement":
        u = np.clip(found.delta_a, *limits.delta_a.T)
    else:
        u = np.clip(found.lambda_a, *limits.lambda_a.T)
    return Belief(found.iterate, u, limits, found.status.value)


def _seen(pilot: Pilot, at: Iterate, measured: Measurement) -> Iterate:
    if measured.delta_a is None:
        raise InputError("the plant has no sensor of delta_a", do="choose another observer")
    if not np.isfinite(measured.delta_a).all():
        return at
    # A jump to what a sensor says teaches no curvature: it may be as short as rounding.
    return replace(at, condensed=pilot.model.at_displacement(measured.delta_a))


def _this_tick(pilot: Pilot, u: np.ndarray) -> Limits:
    """The amplitudes, cut down to what a command that follows u may be."""
    if pilot.command == "displacement":
        return pilot.limits.within(u, pilot.rate)
    low, high = pilot.limits.lambda_a.T
    nearby = np.column_stack([np.clip(u - pilot.rate, low, high), np.clip(u + pilot.rate, low, high)])
    return replace(pilot.limits, lambda_a=nearby)


def _as_published(pilot: Pilot, at: Iterate, aim: Aim, limits: Limits) -> Belief:
    """The forces of the inverse step as they are, and its linearised displacements for where they lead."""
    for _ in range(pilot.settings.iterations):
        nearby = limits.within(at.condensed.delta_a, pilot.settings.step)
        step = inverse_step(at.condensed, aim, nearby, None, pilot.settings.backend)
        at = at.moved(pilot.model.at_displacement(step.delta_a))
    return Belief(at, np.clip(step.lambda_a, *limits.lambda_a.T), limits, ReachStatus.ITERATIONS.value)


def correctable(pilot: Pilot, belief: Belief, error: np.ndarray) -> np.ndarray:
    """(n_e,) mm, the part of error (n_e,) that the actuators can do something about: its projection on the moves of
    the effectors that no bound forbids,

        minimise over s   |w (W_ea s - error)|^2     subject to   s, W_aa s point away from bounds that hold

    The integral of what is left out would grow without end."""
    now: Condensed = belief.iterate.condensed
    pull = pilot.weights[:, None] * now.W_ea
    u = belief.u if pilot.command == "force" else now.lambda_a
    delta = belief.u if pilot.command == "displacement" else now.delta_a
    box, course = _away(u, belief.limits.lambda_a), _away(delta, belief.limits.delta_a)
    if np.isinf(box).all() and np.isinf(course).all():
        s = np.linalg.lstsq(pull, pilot.weights * error, rcond=1e-6)[0]
        return now.W_ea @ s
    H = pull.T @ pull
    H += 1e-9 * np.abs(H).max() * np.eye(len(H))
    qp = solve_qp(H, -pull.T @ (pilot.weights * error), now.W_aa, *course.T, box, pilot.settings.backend)
    return now.W_ea @ qp.x if qp.status is QpStatus.OPTIMAL else np.zeros_like(error)


def _away(value: np.ndarray, bounds: np.ndarray) -> np.ndarray:
    """(n_a, 2) bounds on a change of value (n_a,): 0 where it stands at a bound (n_a, 2), else none."""
    low, high = bounds.T
    width = np.where(np.isfinite(high - low), high - low, 0.0)
    near = AT_BOUND * np.maximum(width, np.where(np.isfinite(bounds), np.abs(bounds), 0.0).max(axis=1))
    return np.column_stack([np.where(value <= low + near, 0.0, -np.inf), np.where(value >= high - near, 0.0, np.inf)])
