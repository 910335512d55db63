"""Spec of the estimate of the mesh's error."""

from pydantic import PositiveInt

from cfem.core.spec import Spec


class MeshErrorSpec(Spec):
    """How the error of the mesh is estimated: the robot at rest and in a few states, with cells half as large."""

    states: PositiveInt = 2
    """Number of states: the one with the largest travel of the effectors, then those farthest from each other."""
    largest: PositiveInt = 60_000
    """No estimate is made where the finer mesh would have more cells."""
