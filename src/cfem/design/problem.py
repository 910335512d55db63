"""All that is asked of a design, as functions of z, shares of the parameters' ranges, evaluated in batches."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from cfem.design.objectives import Objective
from cfem.design.workspace import Robust
from cfem.parametric.differences import Stencil, with_slopes
from cfem.parametric.family import Family, Kind, Varied
from cfem.parametric.states import States

Constraint = Callable[[States], np.ndarray]


class Scores(NamedTuple):
    """objectives (m, n_f), the smaller the better; constraints (m, n_g), >= 0 where they hold."""

    objectives: np.ndarray
    constraints: np.ndarray

    @property
    def feasible(self) -> np.ndarray:
        """(m,)."""
        return (self.constraints >= -1e-9).all(axis=1)


@dataclass
class DesignProblem(Varied):
    """kind, u (n_a,): how every design is actuated. free: numbers of the parameters that vary; p0 (n_p,): values of the
    others. evaluations: designs so far."""

    family: Family
    kind: Kind
    u: np.ndarray
    free: Sequence[int]
    p0: np.ndarray
    objectives: Mapping[str, Objective]
    constraints: Mapping[str, Constraint] = field(default_factory=dict)
    evaluations: int = field(default=0, init=False)

    @property
    def names(self) -> list[str]:
        return list(self.objectives)

    def score(self, states: States) -> Scores:
        m = len(states)
        both = [
            np.stack([self._number(number, states) for number in group.values()], axis=1) if group else np.zeros((m, 0))
            for group in (self.objectives, self.constraints)
        ]
        return Scores(*both)

    def _number(self, objective: Objective, states: States) -> np.ndarray:
        """Values (m,) of an objective; of one over several actuations from states of its own."""
        if isinstance(objective, Robust):
            scattered = self.family.at(self.kind, self.u, objective.parameters(states.p))
            return objective(self._number(objective.of, scattered).reshape(len(states), -1))
        actuations = getattr(objective, "actuations", None)
        if actuations is None:
            return objective(states)
        k, m = len(actuations), len(states)
        return objective(self.family.at(objective.kind, np.tile(actuations, (m, 1)), np.repeat(states.p, k, axis=0)))

    def states(self, z: np.ndarray) -> States:
        """(m, n) -> m states."""
        self.evaluations += len(z)
        return self.family.at(self.kind, self.u, self.p(z))

    def __call__(self, z: np.ndarray) -> Scores:
        """(m, n) -> of m designs."""
        return self.score(self.states(z))

    def with_slopes(self, z: np.ndarray, stencil: Stencil | None = None) -> tuple[np.ndarray, np.ndarray]:
        """(n,) -> objectives and constraints in one row (n_f + n_g,), and their derivatives (n_f + n_g, n)."""
        return with_slopes(lambda batch: np.hstack(self(batch)), z, stencil or self.family.stencil)
