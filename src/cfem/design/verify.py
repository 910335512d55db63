"""Designs of the model judged by finite elements."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cfem.design.problem import DesignProblem, Scores
from cfem.parametric.family import Family
from cfem.parametric.states import States


@dataclass(frozen=True)
class Verified:
    """m designs judged by the model and by finite elements."""

    z: np.ndarray  # (m, n)
    model: Scores
    fe: Scores
    distance: np.ndarray  # (m,) mm between the effectors' positions of the two


def verify(problem: DesignProblem, finite_elements: Family, z: Sequence[np.ndarray]) -> Verified:
    """Objectives of these designs, by the model and by finite elements."""
    z = np.array(z)
    exact = replace(problem, family=finite_elements)
    by_model: States = problem.states(z)
    by_fe: States = exact.states(z)
    distance = np.linalg.norm(by_model.x_e - by_fe.x_e, axis=1)
    return Verified(z, problem.score(by_model), exact.score(by_fe), distance)
