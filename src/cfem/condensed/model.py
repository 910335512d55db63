"""What answers for a robot: a model gives the condensed robot where its actuators stand, and is searched for where they
stand under given forces."""

from collections.abc import Callable
from typing import Literal, Protocol, runtime_checkable

import numpy as np

from cfem.condensed.condensed import Condensed
from cfem.core.errors import NumericalError

EXACT, NEAR = 1e-11, 1e-5  # shares of the displacements: where Newton stops, and what rounding may leave
ITERATIONS, HALVINGS = 60, 12

Form = Literal["displacement", "force"]  # what a model is a function of: delta_a, or lambda_a
Evaluate = Callable[[np.ndarray], Condensed]  # the state at inputs (n_a,) of the form


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

    evaluate: gives the state at inputs of the form
    rounding: largest step, as a share of the displacements on the way, at which a search that stalls is over

    The search is Newton's method, as d delta_a / d lambda_a = W_aa (Legendre's transform of the condensed energy).
    A step that brings the state no nearer is halved. NumericalError where there is no such state."""
    by_force, state = form == "force", near
    scale = np.full(len(wanted), np.finfo(float).tiny)  # of each actuator on the way, in its unit
    for _ in range(ITERATIONS):
        inputs, dual = (state.lambda_a, state.delta_a) if by_force else (state.delta_a, state.lambda_a)
        slope, residual = np.linalg.inv(state.W_aa) if by_force else state.W_aa, wanted - dual
        step = slope @ residual
        strong = np.maximum(np.abs(dual), np.abs(wanted))
        scale = np.maximum(scale, np.maximum(np.abs(inputs), np.abs(slope) @ strong))
        size = float((np.abs(step) / scale).max())
        if size <= EXACT:
            return state
        nearer = None
        for share in 0.5 ** np.arange(HALVINGS):
            try:
                trial = evaluate(inputs + share * step)
            except NumericalError:  # beyond what the model knows: a shorter step may be within it
                continue
            if np.linalg.norm(wanted - (trial.delta_a if by_force else trial.lambda_a)) < np.linalg.norm(residual):
                nearer = trial
                break
        if nearer is None:
            break
        state = nearer
    if size <= rounding:
        return state
    what = f"at the displacements {wanted.tolist()} mm" if by_force else f"under the forces {wanted.tolist()} N"
    left = f"{np.abs(residual).max():.2g} {'mm' if by_force else 'N'} are left"
    raise NumericalError(f"the model has no state {what}: {left}", do="ask nearer to the states of its training")
