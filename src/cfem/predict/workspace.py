"""Workspace of a learned robot: where its effectors are at equilibria that fill what its actuators can do.

States are drawn by force (a low-discrepancy sequence over the forces of the training states), where a cable that only
pulls carries at least nothing. Every such state exists, and a fifth of the draws of each cable leave it slack, so that
the faces of the workspace are drawn too. States outside the reach or unlike the training states are left out."""

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from cfem.condensed import Condensed, Rows
from cfem.core.errors import InputError
from cfem.predict.series.domain import Domain

_SLACK = 0.25  # of the range of forces: drawn below 0 and lifted to it
_ROUNDS = 20  # draws of as many states as are asked for, at most


class Queried(Protocol):
    """What a workspace needs of a model: see `cfem.predict.protocol.Predictor`."""

    rows: Rows
    domain: Domain
    rest_e: np.ndarray
    reach: np.ndarray

    @property
    def pulls(self) -> np.ndarray: ...

    def under_forces(self, lambda_a: np.ndarray) -> tuple[list[Condensed], np.ndarray]: ...

    def inside(self, condensed: Condensed) -> np.ndarray: ...


@dataclass(frozen=True)
class Workspace:
    """States of a learned robot that fill its workspace.

    rows:     names of effector and actuator rows
    delta_a:  (m, n_a) displacements of the actuators, mm or mm^3
    lambda_a: (m, n_a) their forces, N or MPa; 0 of a slack cable
    x_e:      (m, n_e) places of the effectors, mm
    rest_e:   (n_e,) where they rest, mm"""

    rows: Rows
    delta_a: np.ndarray
    lambda_a: np.ndarray
    x_e: np.ndarray
    rest_e: np.ndarray

    def __repr__(self) -> str:
        """Number of states and range of the effectors, for a person."""
        ways = zip(self.rows.effectors, self.x_e.min(axis=0), self.x_e.max(axis=0), strict=True)
        places = ", ".join(f"{name} {low:.4g} to {high:.4g}" for name, low, high in ways)
        return f"<workspace of {len(self.x_e)} states: {places} mm>"

    def plot(self) -> Any:
        """A matplotlib figure of the first effector's places, seen along each axis; colour: the largest share of force.
        Needs matplotlib. InputError where the effector has fewer than two coordinates."""
        from matplotlib.figure import Figure

        effector = self.rows.effectors[0].rpartition(".")[0]
        axes = [(i, name) for i, name in enumerate(self.rows.effectors) if name in {f"{effector}.{k}" for k in "xyz"}]
        views = [(first, second) for k, first in enumerate(axes) for second in axes[k + 1 :]]
        if not views:
            raise InputError(f"effector '{effector}' has fewer than two coordinates", where="workspace.plot")
        figure = Figure(figsize=(4.2 * len(views), 4.2), layout="constrained")
        share = (np.abs(self.lambda_a) / np.abs(self.lambda_a).max(axis=0)).max(axis=1)
        for place, ((i, first), (j, second)) in enumerate(views):
            view = figure.add_subplot(1, len(views), place + 1)
            dots = view.scatter(self.x_e[:, i], self.x_e[:, j], s=4, c=share, vmin=0, vmax=1, cmap="viridis")
            view.plot(self.rest_e[i], self.rest_e[j], "o", color="black", markersize=6)
            view.annotate("rest", (self.rest_e[i], self.rest_e[j]), textcoords="offset points", xytext=(7, 5))
            view.set(xlabel=f"{first} (mm)", ylabel=f"{second} (mm)")
            view.set_aspect("equal", adjustable="datalim")
        figure.colorbar(dots, ax=figure.axes, label="largest share of an actuator's force", shrink=0.8)
        return figure


def workspace_of(model: Queried, states: int, seed: int = 0) -> Workspace:
    """At least one and at most `states` states of the model, at the scene's own parameters. InputError where none of
    those drawn is within the reach and like the training states."""
    if states < 1:
        raise InputError(f"a workspace needs at least one state, got {states}")
    from scipy.stats import qmc

    sequence = qmc.Halton(model.rows.n_a, rng=seed)
    least, most = model.domain.lambda_a
    kept: list[Condensed] = []
    for _ in range(_ROUNDS):
        share = sequence.random(states)
        pulled = np.maximum((1 + _SLACK) * share - _SLACK, 0.0) * most
        kept += _states_within(model, np.where(model.pulls, pulled, least + share * (most - least)))
        if len(kept) >= states:
            break
    if not kept:
        what = "none of the states drawn by force is within the reach and like the training states"
        raise InputError(what, where="workspace", do="sample more states and train again")
    state = Condensed.batch(kept[:states])
    lambda_a = state.lambda_a
    slack = model.pulls & (np.abs(lambda_a) <= 1e-9 * most)
    forces = np.where(slack, 0.0, lambda_a)
    return Workspace(model.rows, state.delta_a, forces, model.rest_e + state.delta_e, model.rest_e)


def _states_within(model: Queried, forces: np.ndarray) -> list[Condensed]:
    """States under forces (m, n_a) that the model has, within its reach and like its training states."""
    states, solved = model.under_forces(forces)
    batch, (low, high) = Condensed.batch(states), model.reach[: model.rows.n_a].T
    within = ((batch.delta_a >= low) & (batch.delta_a <= high)).all(axis=1)
    return [states[place] for place in np.flatnonzero(solved & within & model.inside(batch))]
