"""A contact point: three rows x, y, z in mm that follow the body and carry a force (N)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from cfem.constraint.attachment import attach
from cfem.constraint.effector import PointEffector
from cfem.mechanics.mesh import Mesh


@dataclass(frozen=True)
class ContactPoint(PointEffector):
    """An effector's rows with multipliers: the value is the position, value - rest the displacement. Linear."""

    cliques: ClassVar[tuple[np.ndarray, ...]] = ()

    def curvature(self, x: np.ndarray) -> Sequence[np.ndarray]:
        return ()


def make_contact(mesh: Mesh, point: np.ndarray, radius: float, name: str) -> ContactPoint:
    """A contact at `point` (3,) mm through the region of `radius` mm.

    Raises SpecError where it lies off the body."""
    return ContactPoint(attach(mesh, point, radius, f"contact point '{name}'"))
