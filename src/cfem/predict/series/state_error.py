"""The error of a model at a state, from what it states of all states of its domain."""

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np

from cfem.condensed import Condensed
from cfem.condensed.model import Form
from cfem.condensed.model_error import ModelError, StateError
from cfem.predict.series.domain import Domain

LOADS = 2.2  # times the estimate of the error by loads, which is the middle of what comes true; of patches it is more


class StatesError(Protocol):
    """What is asked of a model that states its error; `Predictor` says what each of these is."""

    form: Form
    meta: Mapping[str, Any]
    domain: Domain
    model_error: ModelError | None

    def inside(self, condensed: Condensed, p: Any = None) -> Any: ...
    def where(self, condensed: Condensed, p: Any = None) -> tuple[np.ndarray, np.ndarray, np.ndarray]: ...
    def christoffel(self, x: np.ndarray) -> np.ndarray: ...
    def load_error(self, delta_a: np.ndarray) -> np.ndarray | None: ...
    def softness(self, p: Any = None) -> Any: ...


def state_error(model: StatesError, state: Condensed, p: np.ndarray | None = None) -> StateError | None:
    """Bounds of the error at states found with the model; None where it states none.

    Under loads that the samples did not carry, what these add comes on top of the tip's: it was not exceeded in 95 % of
    cases (docs/figures/model-error.md)."""
    stated = model.model_error
    if stated is None:
        return None
    L, beyond = extrapolation(model, state, p), np.where(model.inside(state, p), 0.0, np.inf)
    tip = stated.tip.at(L) + beyond
    sizes = reaction_sizes(model, stated.command, p)
    actuators = (stated.actuators.at(L) + beyond)[..., None] * sizes
    entries = (stated.W.at(L) + beyond)[..., None, None] * entry_sizes(state.W)
    by_loads = model.load_error(state.delta_a)
    if by_loads is None:
        return StateError(stated.probability, tip, actuators, entries)
    return StateError(None, tip + by_loads, np.nan * actuators, np.nan * entries)


def extrapolation(model: StatesError, state: Condensed, p: np.ndarray | None = None) -> np.ndarray:
    """Extrapolation (...,) of the model at states found with it (`Christoffel`)."""
    delta_a, lambda_a, q = model.where(state, p)
    s = delta_a if model.form == "displacement" else lambda_a
    return model.christoffel(np.concatenate([s, np.broadcast_to(q, (*s.shape[:-1], q.shape[-1]))], axis=-1))


def reaction_sizes(model: StatesError, command: str, p: np.ndarray | None = None) -> np.ndarray:
    """Largest values (..., n_a) in the domain of what is not commanded, in its unit."""
    if command == "force":
        return np.abs(model.domain.delta_a).max(axis=0)
    return np.abs(model.domain.lambda_a).max(axis=0) / model.softness(p)


def entry_sizes(W: np.ndarray) -> np.ndarray:
    """Sizes (..., n, n) of the entries of W: the root of W_ii W_jj."""
    root = np.sqrt(np.abs(np.diagonal(W, axis1=-2, axis2=-1)))
    return root[..., :, None] * root[..., None, :]
