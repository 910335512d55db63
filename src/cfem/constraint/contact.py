"""A contact point: three rows x, y, z in mm that follow the body and carry a force (N)."""

from dataclasses import dataclass

import numpy as np

from cfem.constraint.attachment import attach
from cfem.constraint.effector import PointEffector
from cfem.constraint.protocol import LinearConstraint
from cfem.mechanics.mesh import Mesh


@dataclass(frozen=True)
class ContactPoint(LinearConstraint, PointEffector):
    """An effector's rows with multipliers: the value is the position, value - rest the displacement."""


def make_contact(mesh: Mesh, point: np.ndarray, radius: float, name: str) -> ContactPoint:
    """A contact at `point` (3,) mm through the region of `radius` mm.

    Raises SpecError where it lies off the body."""
    return ContactPoint(attach(mesh, point, radius, f"contact point '{name}'"))
