"""A robot ready for mechanics: what is meshed, what holds it, what drives it, what touches it, what is watched."""

from dataclasses import dataclass

import numpy as np

from cfem.condensed import Rows
from cfem.condensed.discrepancy import Discrepancy
from cfem.condensed.viscosity import Viscosity
from cfem.constraint.centre_of_mass import CentreOfMass
from cfem.constraint.protocol import Constraint, Watched
from cfem.core.errors import SpecError
from cfem.mechanics.body import Body


@dataclass(frozen=True)
class Robot:
    """What the equations know of a robot.

    name:       of the scene
    body:       the elastic body at rest
    fixed:      indices of held nodes
    actuators:  one constraint a row, in the order of rows.actuators
    effectors:  in the order of rows.effectors
    reach:      (n_a, 2) smallest and largest actuator displacement, mm (chambers: mm^3)
    unilateral: (n_a,) True where the actuator can pull and cannot push
    length:     mm, what '% of length' refers to
    contacts:   contact points, three rows each, in the order of rows.contacts
    rigid:      groups of nodes, each of which moves as one rigid body
    loads:      (n, 3) N constant external nodal forces, None without any
    forces:     (n_a, 2) smallest and largest multiplier of each actuator, None where not all state it
    density:    t/mm^3, one or one a cell of the mesh (m,), None where not all materials state it
    viscosity:  of each material of the body, the main one first; empty where none has any
    skin:       modes of the surface, in the order of rows.skin, None where nobody asks for the shape
    discrepancy: what finite elements lack at the effectors, None where nobody measured it"""

    name: str
    body: Body
    fixed: np.ndarray
    actuators: tuple[Constraint, ...]
    effectors: tuple[Watched, ...]
    rows: Rows
    reach: np.ndarray
    unilateral: np.ndarray
    length: float
    contacts: tuple[Constraint, ...] = ()
    rigid: tuple[np.ndarray, ...] = ()
    loads: np.ndarray | None = None
    forces: np.ndarray | None = None
    density: np.ndarray | float | None = None
    viscosity: tuple[Viscosity, ...] = ()
    skin: Watched | None = None
    discrepancy: Discrepancy | None = None

    @property
    def X(self) -> np.ndarray:
        """Nodes (n, 3) mm at rest."""
        return self.body.mesh.X

    @property
    def facets(self) -> np.ndarray:
        """Facets (k, 3 | 6) of the surface; quadrilaterals as two triangles each."""
        facets = self.body.mesh.facets
        return facets[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3) if facets.shape[1] == 4 else facets

    @property
    def active(self) -> tuple[Constraint, ...]:
        """Constraints that carry multipliers: actuators, then contacts."""
        return self.actuators + self.contacts

    @property
    def watched(self) -> tuple[Watched, ...]:
        """Rows that carry no multiplier: effectors, then the skin."""
        return self.effectors if self.skin is None else (*self.effectors, self.skin)

    @property
    def actuator_units(self) -> tuple[tuple[str, str], ...]:
        """Units (displacement, multiplier) of each actuator."""
        return tuple(actuator.units for actuator in self.actuators)

    @property
    def aims(self) -> np.ndarray:
        """Effector rows (n_e,) bool that goals are set for: all but those of a centre of mass."""
        return np.concatenate(
            [np.full(len(effector.rest), not isinstance(effector, CentreOfMass)) for effector in self.effectors]
        )

    @property
    def masses(self) -> dict[str, float]:
        """Masses, t, by the name of the effector that is the centre of that mass."""
        names = list(dict.fromkeys(row.rpartition(".")[0] for row in self.rows.effectors))
        return {
            name: effector.mass
            for name, effector in zip(names, self.effectors, strict=True)
            if isinstance(effector, CentreOfMass)
        }

    @property
    def rest_e(self) -> np.ndarray:
        """Positions (mm) and orientations (rad) of the effectors at rest, (n_e,)."""
        return np.concatenate([effector.rest for effector in self.effectors])


def watched_displacements(robot: Robot, x: np.ndarray) -> np.ndarray:
    """Displacements (n_e + n_s,), mm and rad from rest, of effectors and skin, nodes at x (n, 3) mm."""
    return np.concatenate([np.empty(0), *(row.value(x) - row.rest for row in robot.watched)])


def demand_without_friction(robot: Robot) -> None:
    """SpecError where a cable rubs in its guides: then no energy stands behind the forces, and W is not symmetric."""
    rubbing = [
        name
        for name, actuator in zip(robot.rows.actuators, robot.actuators, strict=True)
        if getattr(actuator, "friction", 0.0) > 0
    ]
    if rubbing:
        what = f"cable '{rubbing[0]}' has friction, with which the robot has no condensed energy"
        do = "set friction: 0 here; `cfem calibrate-cases` and `cfem predict-cases` follow the friction"
        raise SpecError(what, where=robot.name, do=do)


def demand_without_discrepancy(robot: Robot, what: str) -> None:
    """SpecError where a robot with a discrepancy is asked for something that it says nothing about."""
    if robot.discrepancy is not None:
        do = "take `discrepancy` out of the scene, or leave this out"
        raise SpecError(f"the discrepancy of a calibration says nothing about {what}", where=robot.name, do=do)


def effector_displacements(robot: Robot, x: np.ndarray) -> np.ndarray:
    """Displacements (n_e,), mm and rad from rest, of the effectors, nodes at x (n, 3) mm."""
    return np.concatenate([effector.value(x) - effector.rest for effector in robot.effectors])
