"""Designs of the model judged by finite elements."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from cfem.design.problem import DesignProblem
from cfem.parametric.family import Family


class CheckedDesign(NamedTuple):
    """A design by finite elements: objectives (n_f,), constraints (n_g,); distance: mm between the effectors' places by
    the model and by finite elements."""

    objectives: np.ndarray
    constraints: np.ndarray
    distance: float


def verify(problem: DesignProblem, finite_elements: Family, z: Sequence[np.ndarray]) -> list[CheckedDesign]:
    """These designs by finite elements."""
    z = np.array(z)
    exact = replace(problem, family=finite_elements)
    states = exact.states(z)
    distance = np.linalg.norm(problem.states(z).x_e - states.x_e, axis=1)
    scores = exact.score(states)
    return [CheckedDesign(*row) for row in zip(scores.objectives, scores.constraints, distance.tolist(), strict=True)]
