"""From a goal to an actuation: predict, solve the inverse step, repeat, until the actuators stay put.

One algorithm for a learned model and for the FE model: both answer `at_displacement`. It is sequential
quadratic programming on

    minimise |w (e(delta_a) - goal)|^2 / 2 + |r delta_a|^2 / 2
    subject to lambda(delta_a) and delta_a within bounds

Out of reach the residual stays large and Gauss-Newton (the paper's step, repeated) overshoots or zigzags: its
Hessian lacks S = sum_i w_i^2 (e_i - goal_i) hess e_i. The model gives grad e at every state for nothing, so
hess e is learned from its differences (Powell's symmetric Broyden update); it belongs to the robot, not to the
goal, and is handed from goal to goal. A step that does not lower the cost plus an exact penalty on forbidden
multipliers and effector rows is halved; in a cautious search the penalty never falls."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import Any

import numpy as np

from cfem.condensed import Condensed
from cfem.condensed.model import Model, under_force
from cfem.condensed.strokes import STEP, TOLERANCE, stated_or_share, stroke
from cfem.control.search.inverse import Aim, InverseStep, Limits, inverse_step
from cfem.control.search.optimality import Optimality, Verdict, arrived
from cfem.control.search.qp import Backend
from cfem.core.console.shown import length
from cfem.core.errors import NumericalError

UNMET = 10.0

# The state after a share of an inverse step from a state.
Place = Callable[[Model, Condensed, InverseStep, float], Condensed]


def by_displacement(model: Model, state: Condensed, step: InverseStep, share: float) -> Condensed:
    """The state after a share of a step in displacements."""
    return model.at_displacement(state.delta_a + share * (step.delta_a - state.delta_a))


def by_force(model: Model, state: Condensed, step: InverseStep, share: float) -> Condensed:
    """The state after a share of a step in forces."""
    return under_force(model, state.lambda_a + share * (step.lambda_a - state.lambda_a), state)


class SearchStatus(Enum):
    """How the search ended; the value is the sentence that the user reads."""

    CONVERGED = "converged"
    ITERATIONS = "the iterations allowed were used up"
    NO_ANSWER = "the model has no answer on the way there"
    NO_DESCENT = "no shorter step brings the effectors closer"
    QP_FAILED = "the inverse step has no trustworthy answer"
    TRIED = "no hold that was tried lets the object go to its place"


@dataclass(frozen=True)
class SearchSettings:
    """How a search for a goal goes.

    iterations: inverse steps allowed a goal, 1 is the paper's
    tolerance: a smaller move of every actuator ends the search: (n_a,) in the actuators' units, or one number for all
    step: the largest move of an actuator in one iteration, likewise
    scale: (n_a,) full strokes, in which cables in mm and chambers in mm^3 compare
    halvings: of a step that leads uphill, at most
    backend: solver of the quadratic programs
    cautious: whether bounds of effector rows count before a step has met them"""

    iterations: int = 20
    tolerance: np.ndarray | float = 1e-5
    step: np.ndarray | float = np.inf
    scale: np.ndarray | float = 1.0
    halvings: int = 8
    backend: Backend = "active_set"
    cautious: bool = False

    @classmethod
    def of(
        cls,
        reach: np.ndarray,
        iterations: int,
        tolerance: float | None = None,
        step: float | None = None,
        **more: Any,
    ) -> "SearchSettings":
        """Settings for actuators of this reach (n_a, 2): what is None becomes a share of each stroke."""
        step = stated_or_share(step, STEP, reach)
        return cls(iterations, stated_or_share(tolerance, TOLERANCE, reach), step, stroke(reach), **more)


@dataclass(frozen=True)
class Iterate:
    """State of a search. condensed: the model there; hessian: (n_e, n_a, n_a) 1/mm, hess e as learned so far."""

    condensed: Condensed
    hessian: np.ndarray

    @classmethod
    def at(cls, condensed: Condensed) -> "Iterate":
        rows = condensed.rows
        return cls(condensed, np.zeros((rows.n_e, rows.n_a, rows.n_a)))

    def moved(self, to: Condensed, scale: np.ndarray | float = 1.0) -> "Iterate":
        """The iterate at `to`. Its hessian is the nearest to this one with hess e s = grad e(to) - grad e, s being the
        way there, distances measured in displacements as shares of `scale` (n_a,)."""
        s = to.delta_a - self.condensed.delta_a
        dual = s / np.square(scale)
        square = float(s @ dual)
        if square == 0.0:
            return Iterate(to, self.hessian)
        wrong = to.effector_jacobian - self.condensed.effector_jacobian - self.hessian @ s
        cross = wrong[:, :, None] * dual / square
        twice = (wrong @ s)[:, None, None] * np.outer(dual, dual) / square**2
        return Iterate(to, self.hessian + cross + cross.swapaxes(1, 2) - twice)

    def curvature_root(self, aim: Aim, scale: np.ndarray | float = 1.0) -> np.ndarray | None:
        """Root R (k, n_a) with R^T R the positive part of S in shares of `scale` (n_a,): the convex share, which is all
        of it where the goal lies outside a convex set. None where there is none."""
        if not self.hessian.any():
            return None
        n_e, n_a, _ = self.hessian.shape
        residual = aim.weights**2 * (self.condensed.delta_e - aim.goal)
        S = (residual @ self.hessian.reshape(n_e, n_a * n_a)).reshape(n_a, n_a)
        values, vectors = np.linalg.eigh(S * scale * np.reshape(scale, (-1, 1)))
        convex = values > 0
        return np.sqrt(values[convex])[:, None] * vectors.T[convex] / scale if convex.any() else None


@dataclass(frozen=True)
class SearchResult:
    """The actuation found for one goal, as the model sees it.

    delta_a, lambda_a: (n_a,) mm, N
    delta_e: (n_e,) mm from rest
    distance: mm from the goal
    status: how the search ended
    iterations: inverse steps
    queries: of the model
    softened: whether a step had to widen the course
    kkt: mm, residual of the last program
    seconds: of the whole search
    iterate: to start the next goal from
    aim, limits: what was searched for, within what
    via: displacements (n_a,) to go by on the way there
    tried: whether states around it were tried, as the slopes of a model with kinks tell of one side only
    mesh_error: mm, between which the effectors' error lies that the mesh of the model's samples makes, None where
        nobody has estimated it
    model_error: mm, the effectors' error that the model itself makes there, at most, with the probability that it
        states; infinite outside its domain, None where it states none"""

    delta_a: np.ndarray
    lambda_a: np.ndarray
    delta_e: np.ndarray
    distance: float
    status: SearchStatus
    iterations: int
    queries: int
    softened: bool
    kkt: float
    seconds: float
    iterate: Iterate
    aim: Aim
    limits: Limits
    via: tuple[np.ndarray, ...] = ()
    tried: bool = False
    mesh_error: tuple[float, float] | None = None
    model_error: float | None = None

    def __repr__(self) -> str:
        """Verdict, actuation and distance, for a person."""
        names = self.iterate.condensed.rows.actuators
        actuation = ", ".join(f"{name} {value + 0.0:.4g}" for name, value in zip(names, self.delta_a, strict=True))
        return f"<{self.verdict().value}: {actuation}, {length(self.distance)} from the goal; {self.status.value}>"

    @cached_property
    def optimality(self) -> Optimality:
        """Optimality of the state: one program, solved when it is first asked for."""
        return Optimality.of(self.iterate.condensed, self.aim, self.limits)

    def verdict(self, reached: bool | None = None) -> Verdict:
        """Verdict of the search on its goal. reached: whether the goal counts as reached; unless given, by a miss that
        hardly matters."""
        if arrived(self.iterate.condensed, self.aim, self.limits) if reached is None else reached:
            return Verdict.REACHED
        stuck = self.tried and self.status is SearchStatus.NO_DESCENT
        searched = self.status not in (SearchStatus.NO_ANSWER, SearchStatus.QP_FAILED, SearchStatus.TRIED)
        return Verdict.OUT_OF_REACH if searched and (stuck or self.optimality.holds) else Verdict.NOT_CONVERGED

    @classmethod
    def stays(
        cls,
        aim: Aim,
        limits: Limits,
        iterate: Iterate,
        status: SearchStatus = SearchStatus.NO_ANSWER,
        kkt: float = np.nan,
    ) -> "SearchResult":
        """Result that keeps the actuation of `iterate`, without a search."""
        condensed = iterate.condensed
        state = condensed.delta_a, condensed.lambda_a, condensed.delta_e, aim.distance(condensed.delta_e)
        return cls(*state, status, 0, 0, False, kkt, 0.0, iterate, aim, limits)


def search_goal(
    model: Model,
    aim: Aim,
    limits: Limits,
    start: Iterate,
    settings: SearchSettings = SearchSettings(),
    place: Place = by_displacement,
) -> SearchResult:
    """Search from `start` for the actuation that brings the effectors nearest to the goal; place: whether steps are
    taken in displacements or in forces. Never raises for a numerical failure: the best state found comes back with
    its status."""
    begin = time.perf_counter()
    iterate, status = start, SearchStatus.ITERATIONS
    iterations = queries = 0
    softened, kkt, penalty, course_penalty = False, 0.0, 0.0, 0.0
    while iterations < settings.iterations:
        condensed = iterate.condensed
        try:
            nearby = limits.within(condensed.delta_a, settings.step)
            root = iterate.curvature_root(aim, settings.scale)
            step = inverse_step(condensed, aim, nearby, root, settings.backend)
        except NumericalError:
            status = SearchStatus.QP_FAILED
            break
        iterations += 1
        softened, kkt = softened or step.softened, step.qp.kkt.missed
        if (np.abs(step.delta_a - condensed.delta_a) < settings.tolerance).all():
            status = SearchStatus.CONVERGED
            break
        force_price, course_price = _prices(step, nearby, limits, settings.scale)
        penalty = max(penalty if settings.cautious else 0.0, 2.0 * force_price)
        if settings.cautious:
            penalty = max(penalty, _least_penalty(condensed, aim, limits))
        course_penalty = max(course_penalty, 2.0 * course_price)
        trial, used = _descend(
            lambda share, condensed=condensed, step=step: place(model, condensed, step, share),
            aim,
            limits,
            condensed,
            (penalty, course_penalty),
            settings,
        )
        queries += used
        if trial is None:
            status = SearchStatus.NO_DESCENT
            break
        iterate = iterate.moved(trial, settings.scale)
    condensed = iterate.condensed
    seconds = time.perf_counter() - begin
    distance = aim.distance(condensed.delta_e)
    state = condensed.delta_a, condensed.lambda_a, condensed.delta_e, distance
    return SearchResult(*state, status, iterations, queries, softened, kkt, seconds, iterate, aim, limits)


def _descend(
    along: Callable[[float], Condensed],
    aim: Aim,
    limits: Limits,
    state: Condensed,
    penalties: tuple[float, float],
    settings: SearchSettings,
) -> tuple[Condensed | None, int]:
    """First state along the step, at its end, half way, a quarter, ..., with a lower merit; None where none has."""
    merit = _merit(state, aim, limits, penalties, settings.scale)
    for halving in range(settings.halvings + 1):
        try:
            trial = along(0.5**halving)
        except NumericalError:  # beyond what the robot or the model can do: a shorter step may be within it
            continue
        if _merit(trial, aim, limits, penalties, settings.scale) < merit:
            return trial, halving + 1
    return None, settings.halvings + 1


def _least_penalty(condensed: Condensed, aim: Aim, limits: Limits) -> float:
    """Least penalty on effector rows outside their bounds, which have no price before they have met them: what an
    actuator changes there on its way x costs UNMET times x times what is missed."""
    if limits.delta_e is None:
        return 0.0
    bounded = np.isfinite(limits.delta_e).any(axis=1)
    slope = np.abs(condensed.effector_jacobian[bounded]).max(initial=0.0)
    return UNMET * aim.missed(condensed.delta_e) / slope if slope > 0 else 0.0


def _prices(step: InverseStep, nearby: Limits, limits: Limits, scale: np.ndarray | float) -> tuple[float, float]:
    """Largest multipliers of a step: of the bounds of forces and effector rows, and of the course. A force counts by
    the work that it does along a full stroke, whatever the actuator's units. Steps in forces keep the course to first
    order. Bounds of the step alone have no price."""
    n_a = len(step.delta_a)
    price = max(float(np.abs(step.qp.z / scale).max()), float(np.abs(step.qp.y[n_a:]).max(initial=0.0)))
    course = step.qp.y[:n_a]
    if not course.any():
        return price, 0.0
    return price, float(np.abs(np.where(_at_course(step.delta_a, nearby, limits), course * scale, 0.0)).max())


def _at_course(delta_a: np.ndarray, nearby: Limits, limits: Limits) -> np.ndarray:
    """Mask (n_a,): True where the bound that a step (n_a,) met is one of the course, not of the step alone."""
    upper = np.abs(delta_a - nearby.delta_a[:, 1]) <= np.abs(delta_a - nearby.delta_a[:, 0])
    return np.where(upper, *(nearby.delta_a[:, side] == limits.delta_a[:, side] for side in (1, 0)))


def _merit(
    condensed: Condensed,
    aim: Aim,
    limits: Limits,
    penalties: tuple[float, float],
    scale: np.ndarray | float,
) -> float:
    """Cost plus the exact (l1) penalties on multipliers and effector rows outside their bounds, and on displacements
    off the course, which steps in displacements keep."""
    delta_e, delta_a = condensed.delta_e, condensed.delta_a
    merit = aim.cost(delta_e, delta_a)
    if penalties[0]:
        merit += penalties[0] * limits.outside(delta_e, condensed.lam, scale)
    if penalties[1]:
        merit += penalties[1] * limits.off_course(delta_a, scale)
    return merit
