"""A condensed model as the plant."""

import numpy as np
from numpy.typing import ArrayLike

from cfem.condensed import Condensed
from cfem.condensed.model import Model, PathDependent, Timed, under_force
from cfem.core.errors import NumericalError
from cfem.plant.protocol import Command, Measurement


class ModelPlant:
    """A condensed model as the plant, for trying out: a model that grades itself proves nothing. Actuators stand where
    they are commanded, also where a cable would have to push: its lambda_a is then below zero.

    push: (n_e,) N on the effectors, None without any; it moves them by its linearised compliance."""

    def __init__(self, model: Model, rest_e: np.ndarray, push: np.ndarray | None = None):
        self._model, self._rest_e, self._push, self._t = model, rest_e, push, 0
        self._last: Condensed | None = None

    def step(self, u: ArrayLike, kind: Command = "displacement") -> Measurement:
        """Measurement of the model's state under a command and the push."""
        self._t += 1
        u = np.asarray(u, float)
        try:
            state = self._model.at_displacement(u) if kind == "displacement" else self._under(u)
        except NumericalError as error:
            return Measurement.failed(len(self._rest_e), len(u), self._t, str(error))
        if isinstance(self._model, PathDependent):
            self._model.settle(state.delta_a)
        self._last = state
        delta_e, delta_a, lambda_a = state.delta_e, state.delta_a, state.lambda_a
        if self._push is not None:
            e, W_ae = state.rows.e, state.W_ea.T
            if kind == "force":
                delta_a = delta_a + W_ae @ self._push
            else:
                reaction = np.linalg.solve(state.W_aa, W_ae @ self._push)
                lambda_a, delta_e = lambda_a - reaction, delta_e - state.W_ea @ reaction
            delta_e = delta_e + state.W[e, e] @ self._push
        return Measurement(self._rest_e + delta_e, delta_a, lambda_a, self._t, "converged")

    def pass_to(self, share: float) -> None:
        """Obstacles that move go to where they are at this share of the run, if the model has any."""
        if isinstance(self._model, Timed):
            self._model.pass_to(share)

    def _under(self, lambda_a: np.ndarray) -> Condensed:
        near = self._last or self._model.at_displacement(np.zeros(len(lambda_a)))
        return under_force(self._model, lambda_a, near)
