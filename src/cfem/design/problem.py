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
    """Objectives and constraints of m designs."""

    objectives: np.ndarray  # (m, n_f), the smaller the better
    constraints: np.ndarray  # (m, n_g), >= 0 where they hold

    @property
    def feasible(self) -> np.ndarray:
        """Mask (m,) of the designs whose constraints hold."""
        return (self.constraints >= -1e-9).all(axis=1)


@dataclass
class DesignProblem(Varied):
    """Objectives and constraints of a family's designs, all actuated alike."""

    family: Family
    kind: Kind
    u: np.ndarray  # (n_a,) of every design
    free: Sequence[int]  # numbers of the parameters that vary
    p0: np.ndarray  # (n_p,) values of the others
    objectives: Mapping[str, Objective]
    constraints: Mapping[str, Constraint] = field(default_factory=dict)
    evaluations: int = field(default=0, init=False)

    @property
    def names(self) -> list[str]:
        return list(self.objectives)

    def score(self, states: States) -> Scores:
        m = len(states)
        groups = [
            np.stack([self._number(number, states) for number in group.values()], axis=1) if group else np.zeros((m, 0))
            for group in (self.objectives, self.constraints)
        ]
        return Scores(*groups)

    def _number(self, objective: Objective, states: States) -> np.ndarray:
        """Values (m,) of an objective; of one over several actuations from states of its own."""
        if isinstance(objective, Robust):
            scattered = self.family.at(self.kind, self.u, objective.parameters(states.p))
            return objective(self._number(objective.number, scattered).reshape(len(states), -1))
        actuations = getattr(objective, "actuations", None)
        if actuations is None:
            return objective(states)
        k, m = len(actuations), len(states)
        return objective(self.family.at(objective.kind, np.tile(actuations, (m, 1)), np.repeat(states.p, k, axis=0)))

    def states(self, z: np.ndarray) -> States:
        """States of m designs z (m, n)."""
        self.evaluations += len(z)
        return self.family.at(self.kind, self.u, self.p(z))

    def __call__(self, z: np.ndarray) -> Scores:
        """Scores of m designs z (m, n)."""
        return self.score(self.states(z))

    def with_slopes(self, z: np.ndarray, stencil: Stencil | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Objectives and constraints in one row (n_f + n_g,) at z (n,), and their derivatives (n_f + n_g, n)."""
        return with_slopes(lambda batch: np.hstack(self(batch)), z, stencil or self.family.stencil)
