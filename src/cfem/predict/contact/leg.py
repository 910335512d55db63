"""A learned robot whose effectors are points that touch: it was sampled in the air, and yields to forces f on them with
the actuators at delta_a, to the second order where its samples knew how the compliance changes with forces
(`cfem.predict.loads.wrench_series`):

    x = e + C f + D[f, f] / 2        lambda_a = d/ddelta_a (Psi - f . e - f . C f / 2 - D[f, f, f] / 6)

A cable that would have to push goes slack, as in finite elements: lambda_a = 0, and delta_a is beyond its target."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from cfem.contact.law.path import definite
from cfem.core.errors import InputError
from cfem.predict.kinds.spectral import SpectralPredictor
from cfem.predict.loads.wrench_series import Held, Loaded, WrenchSeries
from cfem.predict.protocol import Predictor

EXACT = 1e-12  # of the displacements and forces: where Newton's method stops
ITERATIONS, HALVINGS = 20, 12
NONE = 1e-9  # N: a cable that pushes by less does not


@dataclass(frozen=True)
class LegState:
    """One state, as `Equilibrium` has it.

    slack: (n_a,) cables that carry nothing
    ratio: `Loaded.ratio`
    delta_e: (m,) mm of the rows behind those of the points"""

    delta_a: np.ndarray
    lambda_a: np.ndarray
    delta_c: np.ndarray
    lambda_c: np.ndarray
    slack: np.ndarray
    converged: bool = True
    factorizations: int = 0
    ratio: float = 0.0
    delta_e: np.ndarray = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True)
class Carrying:
    """`Held` under a constant load (m,) N on the rows behind those of the points, which alone are seen."""

    held: Held
    load: np.ndarray

    def under(self, f: np.ndarray) -> Loaded:
        n, now = len(f), self.held.under(np.concatenate([f, self.load]))
        return replace(now, e=now.e[:n], G=now.G[:n], C=now.C[:n, :n])

    def loaded(self, f: np.ndarray) -> np.ndarray:
        """(m,) mm the displacements of the rows with the load."""
        return self.held.under(np.concatenate([f, self.load])).e[len(f) :]


@dataclass(frozen=True)
class LearnedLeg:
    """`PointRobot`: a learned robot placed by turn (3, 3) and shift (3,) mm.

    held: the model's quantities at delta_a (n_a,) mm
    unilateral: (n_a,) actuators that can go slack
    rest: (k, 3) mm of the points, in its own frame
    load: (m,) N on the rows behind those of the points, such as the weight on the centre of mass, in its own frame"""

    held: Callable[[np.ndarray], Held]
    unilateral: np.ndarray
    rest: np.ndarray
    turn: np.ndarray
    shift: np.ndarray
    load: np.ndarray = field(default_factory=lambda: np.zeros(0))

    def _at(self, delta_a: np.ndarray) -> Carrying:
        return Carrying(self.held(delta_a), self.load)

    @property
    def points(self) -> np.ndarray:
        return self.rest @ self.turn.T + self.shift

    def respond(
        self, actuators: Any, delta_c: np.ndarray, before: Any, tolerance: float = 0.0
    ) -> tuple[LegState, np.ndarray]:
        """State and compliance mm/N of the points held at delta_c mm. actuators: held at their targets, except slack
        cables."""
        target, slack = actuators.target, np.zeros(len(actuators.target), dtype=bool)
        f, delta_a = np.zeros(len(delta_c)), target
        if before is not None:
            f, slack, delta_a = before.lambda_c, before.slack, np.where(before.slack, before.delta_a, target)
        for _ in range(2 * len(target) + 1):
            now, delta_a, f = holding(self._at, delta_a, slack, delta_c, f)
            pushes = self.unilateral & ~slack & (now.lam < -NONE)
            pulled = slack & (delta_a < target)
            if not (pushes | pulled).any():
                break
            slack = (slack | pushes) & ~pulled
            delta_a = np.where(slack, delta_a, target)
        else:
            return LegState(delta_a, now.lam, now.e, f, slack, False), now.C
        G = now.G[:, slack]
        C = now.C + G @ np.linalg.solve(now.K[np.ix_(slack, slack)], G.T)
        behind = self._at(delta_a).loaded(f)
        return LegState(delta_a, now.lam, now.e, f, slack, ratio=now.ratio, delta_e=behind), C


def held_by(model: Predictor, where: Path | None = None) -> Callable[[np.ndarray], Held]:
    """Quantities of a trained model at given displacements, for any load. where: the model's folder. InputError where
    it is no series of the displacements."""
    if not isinstance(model, SpectralPredictor) or model.form != "displacement" or model.parameters:
        what = "a leg needs a model of kind spectral and form displacement without parameters"
        raise InputError(what, where=str(where) if where else None, do="train one")
    return WrenchSeries(model, model.rows.n_e).at


def holding(
    held: Callable[[np.ndarray], Carrying], delta_a: np.ndarray, slack: np.ndarray, x: np.ndarray, f: np.ndarray
) -> tuple[Loaded, np.ndarray, np.ndarray]:
    """State whose points are at x (n_e,) mm and whose slack actuators carry nothing, or as near as steps come that
    leave the robot stable; delta_a (n_a,) mm and the forces f (n_e,) N there. Newton's method from those given."""
    n = len(x)
    now = held(delta_a).under(f)
    for _ in range(ITERATIONS):
        residual = np.concatenate([x - now.e, now.lam[slack]])
        step = np.linalg.solve(_system(now, slack), residual)
        for share in 0.5 ** np.arange(HALVINGS):
            a, g = delta_a.copy(), f + share * step[:n]
            a[slack] += share * step[n:]
            trial = held(a).under(g)
            if definite(trial.C) and definite(trial.K[np.ix_(slack, slack)]):
                left = np.concatenate([x - trial.e, trial.lam[slack]])
                if left @ step >= -abs(residual @ step):
                    break
        else:
            break
        delta_a, f, now = a, g, trial
        if np.linalg.norm(left) <= EXACT * max(1.0, float(np.linalg.norm(x))):
            break
    return now, delta_a, f


def _system(now: Loaded, slack: np.ndarray) -> np.ndarray:
    """Matrix d(e, -lambda of the slack) / d(f, delta_a of the slack); d lambda_a / d f = -(d e / d delta_a)^T."""
    G = now.G[:, slack]
    return np.block([[now.C, G], [G.T, -now.K[np.ix_(slack, slack)]]])
