"""A condensed model as the plant."""

import numpy as np
from numpy.typing import ArrayLike

from cfem.condensed import Condensed
from cfem.condensed.model import Model, PathDependent, Timed, under_force
from cfem.core.errors import NumericalError
from cfem.plant.protocol import Command, Measurement

_NONE = 1e-9  # of the largest force where all are held: what a cable may push
_STEPS = 20  # of Newton's method, for cables that are slack


class ModelPlant:
    """A condensed model as the plant, for trying out: a model that grades itself proves nothing.

    push:       (n_e,) N on the effectors, None without any; it moves them by its linearised compliance
    unilateral: (n_a,) bool, actuators that go slack rather than push, as in finite elements; the others stand where
                they are commanded, also where their lambda_a is below zero. None: all do"""

    def __init__(
        self, model: Model, rest_e: np.ndarray, push: np.ndarray | None = None, unilateral: np.ndarray | None = None
    ):
        self._model, self._rest_e, self._push, self._t = model, rest_e, push, 0
        self._unilateral = np.zeros(0, dtype=bool) if unilateral is None else np.asarray(unilateral, dtype=bool)
        self._last: Condensed | None = None

    def step(self, u: ArrayLike, kind: Command = "displacement") -> Measurement:
        """Measurement of the model's state under a command and the push."""
        self._t += 1
        u = np.asarray(u, float)
        try:
            state = self._at(u) if kind == "displacement" else self._under(u)
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
                reaction = self._reaction(state)
                lambda_a, delta_e = lambda_a - reaction, delta_e - state.W_ea @ reaction
            delta_e = delta_e + state.W[e, e] @ self._push
        return Measurement(self._rest_e + delta_e, delta_a, lambda_a, self._t, "converged")

    def pass_to(self, share: float) -> None:
        """Obstacles that move go to where they are at this share of the run, if the model has any."""
        if isinstance(self._model, Timed):
            self._model.pass_to(share)

    def _reaction(self, state: Condensed) -> np.ndarray:
        """Forces (n_a,) N by which the push unloads actuators that are held."""
        if self._push is None:
            return np.zeros(state.rows.n_a)
        return np.linalg.solve(state.W_aa, state.W_ea.T @ self._push)

    def _at(self, target: np.ndarray) -> Condensed:
        """The state in which each actuator is at its target (n_a,) mm, or is slack beyond it and carries nothing. Which
        are slack is found as an active set. NumericalError where none is found."""
        state = self._model.at_displacement(target)
        if not self._unilateral.any():
            return state
        none = _NONE * float(np.abs(state.lambda_a - self._reaction(state)).max())
        slack = np.zeros(len(target), dtype=bool)
        for _ in range(2 * len(target) + 1):
            pushes = self._unilateral & ~slack & (state.lambda_a - self._reaction(state) < -none)
            taken_up = slack & (state.delta_a < target)
            if not (pushes | taken_up).any():
                return state
            slack = (slack | pushes) & ~taken_up
            state = self._let_go(state, target, slack, none)
        raise NumericalError("no state was found in which cables that would push are slack")

    def _let_go(self, state: Condensed, target: np.ndarray, slack: np.ndarray, none: float) -> Condensed:
        """The state in which actuators that are slack (n_a,) bool carry no more than `none` N, and the others are at
        their targets (n_a,) mm, by Newton's method from a state near it."""
        delta = np.where(slack, state.delta_a, target)
        for _ in range(_STEPS):
            state = self._model.at_displacement(delta)
            force = (state.lambda_a - self._reaction(state))[slack]
            if (np.abs(force) <= none).all():
                return state
            delta[slack] -= np.linalg.solve(np.linalg.inv(state.W_aa)[np.ix_(slack, slack)], force)
        raise NumericalError("no state was found in which cables that would push carry nothing")

    def _under(self, lambda_a: np.ndarray) -> Condensed:
        near = self._last or self._model.at_displacement(np.zeros(len(lambda_a)))
        return under_force(self._model, lambda_a, near)
