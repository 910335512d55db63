"""What control acts on: a plant takes a command and says what became of it."""

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from cfem.control.loop import Model
from cfem.core.errors import NumericalError

Command = Literal["displacement", "force"]


@dataclass(frozen=True)
class Measurement:
    """x_e: (n_e,) mm absolute positions of the effectors; delta_a (n_a,) mm and lambda_a (n_a,) N, None where
    no sensor gives them; t: number of the step; status: 'converged', or the sentence that says why not
    (numbers are then NaN)."""

    x_e: np.ndarray
    delta_a: np.ndarray | None
    lambda_a: np.ndarray | None
    t: int
    status: str


class Plant(Protocol):
    """The robot, or what stands for it."""

    def step(self, u: np.ndarray, kind: Command = "displacement") -> Measurement:
        """Command the actuators: u (n_a,), displacements in mm or forces in N."""
        ...


class ModelPlant:
    """A condensed model as the plant. Good for trying things out; a model that grades itself proves nothing."""

    def __init__(self, model: Model, rest_e: np.ndarray):
        self._model, self._rest_e, self._t = model, rest_e, 0
        self._delta_a: np.ndarray | None = None

    def step(self, u: np.ndarray, kind: Command = "displacement") -> Measurement:
        self._t += 1
        u = np.asarray(u, float)
        try:
            state = self._model.at_displacement(u) if kind == "displacement" else self._under(u)
        except NumericalError as error:
            nothing = np.full(len(u), np.nan)
            return Measurement(np.full(len(self._rest_e), np.nan), nothing, nothing, self._t, str(error))
        self._delta_a = state.delta_a
        return Measurement(self._rest_e + state.delta_e, state.delta_a, state.lambda_a, self._t, "converged")

    def _under(self, lambda_a: np.ndarray):
        """Newton on lambda(delta_a) = lambda_a, whose derivative is W_aa^-1, from the last state."""
        delta_a = np.zeros(len(lambda_a)) if self._delta_a is None else self._delta_a
        for _ in range(50):
            state = self._model.at_displacement(delta_a)
            missing = lambda_a - state.lambda_a
            if np.linalg.norm(missing) <= 1e-9 * max(1.0, float(np.linalg.norm(lambda_a))):
                return state
            delta_a = delta_a + state.W_aa @ missing
        raise NumericalError(f"the model finds no state under {lambda_a.tolist()} N")
