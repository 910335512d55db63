"""What answers for a robot: a model gives the condensed robot where its actuators stand, and is searched for where they
stand under given forces."""

from typing import Protocol, runtime_checkable

import numpy as np

from cfem.condensed.condensed import Condensed
from cfem.core.errors import NumericalError

EXACT, NEAR = 1e-11, 1e-5  # shares of the displacements: where Newton stops, and what rounding may leave
ITERATIONS, HALVINGS = 40, 12


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
    state, scale = near, np.full(len(lambda_a), np.finfo(float).tiny)  # scale: of each actuator on the way, in its unit
    for _ in range(ITERATIONS):
        residual = lambda_a - state.lambda_a
        delta = state.delta_a
        step = state.W_aa @ residual
        strong = np.maximum(np.abs(state.lambda_a), np.abs(lambda_a))
        scale = np.maximum(scale, np.maximum(np.abs(delta), np.abs(state.W_aa) @ strong))
        size = float((np.abs(step) / scale).max())
        if size <= EXACT:
            return state
        trial = None
        for share in 0.5 ** np.arange(HALVINGS):
            try:
                trial = model.at_displacement(delta + share * step)
            except NumericalError:  # beyond what the model knows: a shorter step may be within it
                trial = None
                continue
            if np.linalg.norm(lambda_a - trial.lambda_a) < np.linalg.norm(residual):
                break
        else:
            if size <= NEAR:
                return state
            trial = None
        if trial is None:
            break
        state = trial
    raise NumericalError(f"the model has no state under the forces {np.asarray(lambda_a).tolist()} N")
