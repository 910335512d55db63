"""Contact points that are held: the actuation that does it, and the rigid patch that they make."""

import numpy as np

from cfem.condensed.pose import Patch
from cfem.equilibrium.system.actuation import Actuation
from cfem.equilibrium.system.problem import Problem


def patch_of(points: np.ndarray, turns: bool) -> Patch:
    """All contact points (k, 3) mm as one rigid patch about their mean."""
    return Patch(points, points.mean(axis=0), turns)


def contact_points(problem: Problem) -> np.ndarray:
    """Contact points (k, 3) mm at rest."""
    return np.array([point.rest for point in problem.robot.contacts]).reshape(-1, 3)


def held(actuators: Actuation, delta_c: np.ndarray) -> Actuation:
    """`actuators` (n_a), and the contact rows held at delta_c (n_c,) mm from rest."""
    m, n_a, n_c = len(actuators.C), actuators.n, len(delta_c)
    C = np.zeros((m + n_c, n_a + n_c))
    C[:m, :n_a], C[m:, n_a:] = actuators.C, np.eye(n_c)
    target = np.concatenate([actuators.target, delta_c])
    return Actuation(C, target, np.concatenate([actuators.offset, np.zeros(n_c)]), actuators.load)
