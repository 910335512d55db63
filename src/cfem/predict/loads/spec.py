"""Constant loads on effectors and on patches of the surface as a user states them: a push, or a payload."""

from collections.abc import Mapping

import numpy as np
from pydantic import Field

from cfem.constraint.patch import PatchLoad
from cfem.core.errors import SpecError
from cfem.core.spec import Spec
from cfem.core.units import AccelerationVector, ForceVector, Length, Mass, Point


class LoadSpec(Spec):
    """A constant load that the samples did not carry: a force, the weight of a payload, or gravity on the robot's own
    mass, which acts on an effector at its centre of mass. It acts on the effector of its name, or with `at` and
    `radius` on a patch of the surface."""

    at: Point | None = None
    """A point of the surface at rest, for a load on a patch about it instead of an effector. The model needs a skin."""
    radius: Length | None = Field(None, gt=0)
    """Radius of the patch. The force spreads over the surface within it, and fades to the rim."""
    force: ForceVector | None = None
    """Force along x, y and z."""
    mass: Mass | None = Field(None, gt=0)
    """Mass of a payload. Its inertia does not matter, as the robot is at rest."""
    gravity: AccelerationVector | None = None
    """Acceleration of gravity along x, y and z, which gives the payload its weight. Without a mass: on the robot's own,
    in addition to what the scene has."""

    def check(self) -> None:
        if (self.force is None) == (self.gravity is None) or (self.mass is not None and self.gravity is None):
            raise ValueError(
                "expected force, or gravity with or without mass, such as {mass: 20 g, gravity: {m/s^2: [0, 0, -9.81]}}"
            )
        if (self.at is None) != (self.radius is None):
            raise ValueError("a patch of the surface has both at and radius")

    def newtons(self, own_mass: float | None = None) -> np.ndarray | None:
        """Force (3,) N; own_mass: t, the mass whose centre the effector is. None where no mass is known."""
        mass = own_mass if self.mass is None else self.mass
        if self.force is not None:
            return np.asarray(self.force, float)
        return None if mass is None else mass * np.array(self.gravity)


def loads_of(
    loads: Mapping[str, LoadSpec], masses: Mapping[str, float]
) -> tuple[dict[str, np.ndarray], tuple[PatchLoad, ...]]:
    """Forces (3,) N by the name of the effector, and those on patches. masses: t, of robots by the name of the effector
    that is their centre. SpecError where gravity acts on no mass."""
    forces = {name: load.newtons(None if load.at is not None else masses.get(name)) for name, load in loads.items()}
    for name, force in forces.items():
        if force is None:
            raise SpecError(
                f"'{name}' has no mass that gravity could act on",
                where=f"loads.{name}",
                do="state a mass, or give the scene an effector with `at: centre-of-mass` and sample it",
            )
    on = {name: load for name, load in loads.items() if load.at is not None}
    patches = tuple(PatchLoad(load.at, load.radius, forces[name], name) for name, load in on.items())
    return {name: force for name, force in forces.items() if name not in on}, patches
