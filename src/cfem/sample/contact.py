"""Plans of a robot whose contact points are held in a rigid patch: cable forces and poses, drawn together.

Forces, not displacements: what a cable's displacement may be depends on where the patch is held, and a patch held near
rest while its cables are shortened far buckles the robot. So does one that is held along a finger's axis at a length
that the pulled finger does not have: such an axis is better drawn about where the patch would rest."""

from dataclasses import dataclass

import numpy as np

from cfem.condensed.pose import COORDINATES, Patch, resting
from cfem.core.actuator_units import demand_units
from cfem.equilibrium.contact.held_patch import held
from cfem.equilibrium.system.actuation import Actuation, force
from cfem.sample.solver import Facts
from cfem.sample.spec import SampleSpec


@dataclass(frozen=True)
class ContactPlan:
    """Forces and poses to draw of a robot with a patch, picklable.

    low, high: (n_a + n,) bounds of each actuator's force (N), then of the patch's pose (mm, rad)
    turns: whether the patch can turn: n = 6 then, else 3
    about_rest: coordinates of the pose that are drawn relative to `resting`"""

    low: tuple[float, ...]
    high: tuple[float, ...]
    turns: bool
    about_rest: tuple[int, ...] = ()

    def actuation(self, u: np.ndarray, patch: Patch, compliance: np.ndarray) -> tuple[Actuation, np.ndarray]:
        """Actuation of row u in [0, 1], and its pose. compliance (n_a + n, n_a + n): at rest, of actuators and pose."""
        values = np.array(self.low) + u * (np.array(self.high) - np.array(self.low))
        n_a = len(u) - patch.n
        if self.about_rest:
            values[n_a:] += resting(compliance, n_a, self.about_rest) @ values
        return held(force(values[:n_a]), patch.displacement(values[n_a:])), values[n_a:]


def contact_plan(spec: SampleSpec, facts: Facts) -> ContactPlan | None:
    """Plan of what the spec's `contact` draws."""
    if spec.contact is None:
        return None
    demand_units(spec, facts.row_units[facts.rows.a])
    n_a = facts.rows.n_a
    turns = spec.contact.rotation is not None
    poses = [spec.contact.translation] + ([spec.contact.rotation] if turns else [])
    low, high = np.concatenate([np.tile([0.0, spec.contact.force], (n_a, 1)), *poses]).T.tolist()
    about_rest = tuple(sorted(COORDINATES.index(axis) for axis in set(spec.contact.about_rest)))
    return ContactPlan(tuple(low), tuple(high), turns, about_rest)
