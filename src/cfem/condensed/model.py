"""Protocols of models: a model gives the condensed robot where its actuators stand, and is searched for where they
stand under given forces."""

from collections.abc import Callable, Sequence
from typing import Literal, Protocol, runtime_checkable

import numpy as np

from cfem.condensed.condensed import Condensed
from cfem.core.errors import NumericalError

EXACT, NEAR = 1e-11, 1e-5  # shares of the displacements: where Newton stops, and what rounding may leave
ITERATIONS, HALVINGS = 60, 12

Form = Literal["displacement", "force"]  # what a model is a function of: delta_a, or lambda_a
Evaluate = Callable[[np.ndarray], Condensed]  # the state at inputs (n_a,) of the form
EvaluateMany = Callable[[np.ndarray, np.ndarray], Sequence[Condensed]]  # of several, and which of them these are


class Model(Protocol):
    """Whatever can condense the robot where its actuators stand."""

    def at_displacement(self, delta_a: np.ndarray) -> Condensed:
        """Condensed at delta_a (n_a,) mm, effectors from rest. NumericalError where it has no answer."""
        ...


@runtime_checkable
class PathDependent(Protocol):
    """A model whose answers depend on the way that it has come, as those with contact and friction do."""

    def settle(self, delta_a: np.ndarray) -> None:
        """Makes the state at delta_a (n_a,) mm the one from which the next step begins."""
        ...


@runtime_checkable
class Timed(Protocol):
    """A model or a plant with obstacles that move during a run."""

    def pass_to(self, share: float) -> None:
        """Moves the obstacles to where they are at this share, 0 to 1, of the run."""
        ...


@runtime_checkable
class KnowsDomain(Protocol):
    """A model that can tell how far a state is from those that it was trained on."""

    def inside(self, condensed: Condensed) -> bool:
        """True where a state is like those of the training."""
        ...

    def distance(self, condensed: Condensed) -> float:
        """Distance of a state from those of the training; 1 is the largest of theirs."""
        ...


@runtime_checkable
class KnowsStates(Protocol):
    """A model that has kept some of the states that it was trained on."""

    @property
    def trained(self) -> np.ndarray:
        """Displacements (k, n_a) of training states, spread over all of them, the middle first."""
        ...


@runtime_checkable
class KnowsSlopes(Protocol):
    """A model that answers forces and stiffness of many states at once."""

    def slopes(self, delta_a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Forces lambda_a (B, n_a) and d lambda_a / d delta_a (B, n_a, n_a) at delta_a (B, n_a) mm."""
        ...


def under_force(model: Model, lambda_a: np.ndarray, near: Condensed) -> Condensed:
    """The model under lambda_a (n_a,) N or MPa, searched from the state `near`. NumericalError where it has none."""
    if getattr(model, "form", "displacement") == "force":
        return model.at_force(lambda_a)
    return with_dual(model.at_displacement, "displacement", lambda_a, near)


def with_dual(evaluate: Evaluate, form: Form, wanted: np.ndarray, near: Condensed, rounding: float = NEAR) -> Condensed:
    """State whose forces are `wanted` (n_a,), or whose displacements are where `form` is 'force'; searched from `near`.
    NumericalError where there is no such state. evaluate: gives the state at inputs of the form; rounding: as below."""
    states, left = with_duals(lambda inputs, _: [evaluate(inputs[0])], form, wanted[None], [near], rounding)
    demand_found(form, wanted[None], left)
    return states[0]


def with_duals(
    evaluate: EvaluateMany, form: Form, wanted: np.ndarray, near: Sequence[Condensed], rounding: float = NEAR
) -> tuple[list[Condensed], np.ndarray]:
    """States whose forces are `wanted` (m, n_a), or whose displacements are where `form` is 'force', each searched from
    its own of `near`; and what is left of each (m,) in N or mm, 0 where it is found.

    evaluate: gives the states at inputs (k, n_a) of the form, of those with the numbers (k,)
    rounding: largest step, as a share of the displacements on the way, at which a search that stalls is over

    The search is Newton's method, as d delta_a / d lambda_a = W_aa (Legendre's transform of the condensed energy), of
    all states at once. A step that brings its state no nearer is halved."""
    by_force, states = form == "force", list(near)
    scale = np.full(wanted.shape, np.finfo(float).tiny)  # of each actuator on the way, in its unit
    size, missing = np.full(len(wanted), np.inf), np.full(len(wanted), np.inf)
    searched = np.arange(len(wanted))
    for _ in range(ITERATIONS):
        delta_a, lambda_a = (np.array([getattr(states[i], name) for i in searched]) for name in ("delta_a", "lambda_a"))
        inputs, dual = (lambda_a, delta_a) if by_force else (delta_a, lambda_a)
        slope = np.array([states[i].W_aa for i in searched])
        slope, residual = np.linalg.inv(slope) if by_force else slope, wanted[searched] - dual
        step = (slope @ residual[..., None])[..., 0]
        strong = np.maximum(np.abs(dual), np.abs(wanted[searched]))
        scale[searched] = np.maximum(
            scale[searched], np.maximum(np.abs(inputs), (np.abs(slope) @ strong[..., None])[..., 0])
        )
        size[searched] = (np.abs(step) / scale[searched]).max(axis=1)
        missing[searched] = np.abs(residual).max(axis=1)
        going = size[searched] > EXACT
        searched, inputs, step = searched[going], inputs[going], step[going]
        distance, waiting = np.linalg.norm(residual[going], axis=1), np.arange(len(searched))
        for share in 0.5 ** np.arange(HALVINGS):
            if not len(waiting):
                break
            trials = _known(evaluate, inputs[waiting] + share * step[waiting], searched[waiting])
            duals = [None if trial is None else trial.delta_a if by_force else trial.lambda_a for trial in trials]
            reached = np.array([np.full(wanted.shape[1], np.inf) if dual is None else dual for dual in duals])
            nearer = np.linalg.norm(wanted[searched[waiting]] - reached, axis=1) < distance[waiting]
            for place in np.flatnonzero(nearer):
                states[searched[waiting[place]]] = trials[place]
            waiting = waiting[~nearer]
        searched = np.delete(searched, waiting)
        if not len(searched):
            break
    return states, np.where(size <= rounding, 0.0, missing)


def _known(evaluate: EvaluateMany, inputs: np.ndarray, numbers: np.ndarray) -> list[Condensed | None]:
    """States (k,) at inputs (k, n_a), None beyond what the model knows, where a shorter step may be within it. One that
    it refuses costs the others nothing."""
    try:
        return list(evaluate(inputs, numbers))
    except NumericalError:
        if len(inputs) == 1:
            return [None]
        return [_known(evaluate, *single)[0] for single in zip(inputs[:, None], numbers[:, None], strict=True)]


def demand_found(form: Form, wanted: np.ndarray, left: np.ndarray) -> None:
    """NumericalError unless all states that `wanted` (m, n_a) asks for are found; left (m,): residuals in the unit of
    `wanted`, 0 of a state that is (`with_duals`)."""
    where, unit = ("at the displacements", "mm") if form == "force" else ("under the forces", "N")
    for asked, rest in zip(wanted.tolist(), left, strict=True):
        if rest:
            what = f"the model has no state {where} {asked} {unit}: {rest:.2g} {unit} are left"
            raise NumericalError(what, do="ask nearer to the states of its training")
