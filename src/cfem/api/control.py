"""Control with a learned model: one inverse step, a search, a controller."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from cfem.api.vectors import vector
from cfem.core.errors import SpecError
from cfem.core.optional import says_what_is_missing

if TYPE_CHECKING:
    from cfem.condensed import Condensed
    from cfem.control.closed_loop.controller import Controller
    from cfem.control.closed_loop.tick import Observer
    from cfem.control.search.goal_search import SearchResult
    from cfem.control.search.inverse import InverseStep, Limits
    from cfem.equilibrium.system.robot import Robot
    from cfem.plant.gains import Gains
    from cfem.plant.protocol import Command
    from cfem.predict.protocol import Predictor


@says_what_is_missing
def inverse_step(
    model: "Predictor | Robot",
    state: "Condensed",
    goal: ArrayLike,
    *,
    step: float = np.inf,
    unilateral: bool = True,
    largest_force: float = np.inf,
    weights: ArrayLike | None = None,
    regularisation: float = 1e-10,
) -> "InverseStep":
    """One quadratic program: the actuation that, by the linearisation at a state, brings the effectors to the goal.

    Args:
        model: the model or the robot that the state is of; it says rest, reach and length.
        state: of `model.at_displacement`, or `solve(...).condensed`.
        goal: (n_e,) absolute position of the effectors, mm (rotation vectors in rad).
        step: largest change of an actuator's displacement, mm or mm^3.
        unilateral: actuators pull and do not push. A robot knows this itself.
        largest_force: of any actuator, N or MPa.
        weights: (n_e,) of the effector rows, 1 unless given; 0 for rows that do not matter.
        regularisation: cost of a full stroke relative to missing by the robot's length.

    Returns:
        The step: `delta_a`, `lambda_a` (n_a,), `softened` (no force within bounds keeps the reach), `qp` (residuals).

    Raises:
        SpecError: goal or weights are not n_e finite numbers.
        InputError: the goal is not in mm, as it is two lengths of the robot away, or in metres.
        NumericalError: the program has no trustworthy answer.

    Examples:
        >>> state = model.at_displacement([0.0, 0.0])
        >>> cfem.inverse_step(model, state, model.rest_e + [1.0, 0.0, 0.0]).delta_a
    """
    from cfem.condensed.strokes import ridge_of
    from cfem.control.search.inverse import Aim
    from cfem.control.search.inverse import inverse_step as solve_step

    n_e = model.rows.n_e
    aim = Aim(_meant(model, goal), _weights(weights, n_e), ridge_of(regularisation, model.reach, model.length))
    limits = _limits(model, unilateral, largest_force).within(state.delta_a, step)
    return solve_step(state, aim, limits)


@says_what_is_missing
def find_actuation(
    model: "Predictor",
    goal: ArrayLike,
    *,
    start: ArrayLike | None = None,
    unilateral: bool = True,
    largest_force: float = np.inf,
    weights: ArrayLike | None = None,
    regularisation: float = 1e-10,
    iterations: int = 20,
) -> "SearchResult":
    """Inverse steps until the actuators stay where they are: the actuation that brings the effectors nearest to a goal.

    Args:
        model: of `load_model`.
        goal: (n_e,) absolute position of the effectors, mm (rotation vectors in rad).
        start: (n_a,) displacements to start from, 0 unless given.
        unilateral: as for `inverse_step`.
        largest_force: as for `inverse_step`.
        weights: as for `inverse_step`.
        regularisation: as for `inverse_step`.
        iterations: inverse steps at most.

    Returns:
        What was found: `delta_a`, `lambda_a` (n_a,), `distance` mm that remains, `status`, which says how it ended, and
        `verdict()`: reached, out of reach (the optimality conditions show it), or not converged. `mesh_error`: between
        how many mm the error lies that the mesh of the samples adds, None without `mesh_error` in sample.yaml.
        `model_error`: the model's own error there, mm at most, infinite outside its domain (`Predictor.error`).

    Raises:
        SpecError: goal, start or weights have a wrong length or are not finite.
        InputError: the goal is not in mm, as it is two lengths of the robot away, or in metres.
        NumericalError: the model has no answer at the start.

    Examples:
        >>> found = cfem.find_actuation(model, [0.0, 10.0, -115.0])
        >>> found.delta_a, found.distance, found.status
    """
    from cfem.condensed.strokes import ridge_of
    from cfem.control.search.goal_search import Iterate, SearchSettings, by_displacement, search_goal
    from cfem.control.search.inverse import Aim
    from cfem.control.search.multistart import RESTARTS, all_over, multistart

    n_e, n_a = model.rows.n_e, model.rows.n_a
    aim = Aim(_meant(model, goal), _weights(weights, n_e), ridge_of(regularisation, model.reach, model.length))
    first = model.at_displacement(np.zeros(n_a) if start is None else vector("start", start, n_a))
    limits, settings = _limits(model, unilateral, largest_force), SearchSettings.of(model.reach, iterations)
    result = search_goal(model, aim, limits, Iterate.at(first), settings)
    result = multistart(model, aim, limits, result, settings, by_displacement, all_over(model, limits, RESTARTS))
    error = model.error(result.iterate.condensed)
    model_error = None if error is None else float(error.tip)
    return replace(result, mesh_error=model.tip_error_of_mesh(result.delta_e), model_error=model_error)


@says_what_is_missing
def make_controller(
    model: "Predictor",
    *,
    command: "Command" = "displacement",
    observer: "Observer" = "equilibrium",
    gains: tuple[float, float] | None = None,
    phase_margin: float = 60.0,
    rate: float = np.inf,
    iterations: int = 1,
    unilateral: bool = True,
    largest_force: float = np.inf,
    weights: ArrayLike | None = None,
    regularisation: float = 1e-10,
    start: ArrayLike | None = None,
) -> "Controller":
    """A controller that turns one goal per tick into one command.

    Args:
        model: of `load_model`.
        command: what the drives take, displacements or forces.
        observer: how it knows where the actuators stand; see control.yaml.
        gains: (K_P, K_I) on the measured error, per sample; (0, 0) for open loop. Unless given, K_P is 0 and K_I leaves
            `phase_margin` at the delay and interval of the samples that come.
        phase_margin: degrees, between 0 and 90.
        rate: largest change of a command per tick, mm or N (mm^3 or MPa).
        iterations: inverse steps per tick.
        unilateral: as for `inverse_step`.
        largest_force: as for `inverse_step`.
        weights: as for `inverse_step`.
        regularisation: as for `inverse_step`.
        start: (n_a,) displacements at the start, 0 unless given.

    Returns:
        The controller. `controller.tick(goal, measured)` returns the belief after the tick: `u` (n_a,) the command, and
        `status`: 'tracking' on the way, 'converged' at the goal, 'out of reach' at the nearest point to it, or what
        went wrong. It raises InputError for a goal that is not in mm: two lengths of the robot away, or in metres.
        `measured` is the latest sample; its `t` is the number of the command that it followed, from 1 on. A sample
        corrects once. Without samples the loop is open.

    Raises:
        SpecError: weights or start have a wrong length or are not finite, or the phase margin is out of range.
        NumericalError: the model has no answer at the start.

    Examples:
        >>> controller, plant = cfem.make_controller(model), cfem.FemPlant(robot)
        >>> measured = plant.step(controller.tick(goal).u)
        >>> measured = plant.step(controller.tick(goal, measured).u)
    """
    from cfem.condensed.far import far_of
    from cfem.condensed.strokes import ridge_of
    from cfem.control.closed_loop.controller import Controller
    from cfem.control.closed_loop.tick import Pilot
    from cfem.control.search.goal_search import SearchSettings

    limits, n_e = _limits(model, unilateral, largest_force), model.rows.n_e
    ridge = ridge_of(regularisation, model.reach, model.length)
    search = SearchSettings.of(model.reach, iterations, step=np.inf)
    pilot = Pilot(model, command, observer, limits, _weights(weights, n_e), ridge, search, rate)
    first = None if start is None else vector("start", start, model.rows.n_a)
    return Controller(pilot, model.rest_e, _feedback(gains, phase_margin), first, far_of(model.rows, model.length))


def _meant(model: "Predictor | Robot", goal: ArrayLike) -> np.ndarray:
    """Goal (n_e,) mm from rest. SpecError where it has not n_e finite numbers, InputError where it cannot be in mm."""
    from cfem.condensed.far import demand_near, far_of

    wanted = vector("goal", goal, model.rows.n_e)
    demand_near(wanted, model.rest_e, far_of(model.rows, model.length))
    return wanted - model.rest_e


def _feedback(gains: tuple[float, float] | None, phase_margin: float) -> "Gains":
    """Gains (K_P, K_I) of the feedback, or the phase margin (degrees) that determines K_I. SpecError out of range."""
    from cfem.plant.gains import Gains

    if not 0 < phase_margin < 90:
        raise SpecError(f"{phase_margin:g} is not between 0 and 90", where="phase_margin")
    return Gains(phase_margin=np.deg2rad(phase_margin)) if gains is None else Gains(*gains)


def _weights(weights: ArrayLike | None, n_e: int) -> np.ndarray:
    """Weights (n_e,) of the effector rows, 1 unless given. SpecError where these are negative or all 0."""
    if weights is None:
        return np.ones(n_e)
    checked = vector("weights", weights, n_e)
    if (checked < 0).any() or not checked.any():
        raise SpecError(
            f"expected numbers from 0 on, of which one is positive, got {checked.tolist()}",
            where="weights",
            do="give rows that do not matter 0, and another one a positive number",
        )
    return checked


def _limits(model: "Predictor | Robot", unilateral: bool, largest_force: float) -> "Limits":
    """Bounds of displacements and forces of the actuators; a robot says itself which of them only pull."""
    from cfem.control.search.inverse import Limits

    signs = np.asarray(getattr(model, "unilateral", np.full(model.rows.n_a, unilateral)))
    limits = Limits.of(model.reach, signs)
    limits.lambda_a.clip(-largest_force, largest_force, out=limits.lambda_a)
    return limits
