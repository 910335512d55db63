"""The centre of mass of a body as an effector: gravity g is a force m g on its rows, as its work is m g . c(x)."""

from dataclasses import dataclass

import numpy as np

from cfem.core.errors import SpecError
from cfem.mechanics.body import Body
from cfem.mechanics.mass import gravity


@dataclass(frozen=True)
class CentreOfMass:
    """The centre c = sum_i m_i x_i / m with the nodal masses m_i (n,) that weight acts on
    (`cfem.mechanics.mass.gravity`).

    nodes: (n,)
    shares: (n,) of sum 1
    rest: (3,) mm
    mass: t"""

    nodes: np.ndarray
    shares: np.ndarray
    rest: np.ndarray
    mass: float

    def value(self, x: np.ndarray) -> np.ndarray:
        return self.shares @ x[self.nodes]

    def gradient(self, x: np.ndarray) -> np.ndarray:
        return np.einsum("ij,k->ikj", np.eye(3), self.shares)


def centre_of_mass(body: Body, density: np.ndarray | None, name: str) -> CentreOfMass:
    """Centre of mass of a body. density: t/mm^3, one a cell of the mesh (m,), None where not all materials state it:
    SpecError."""
    if density is None:
        what = f"effector '{name}': the centre of mass needs the density of each material"
        raise SpecError(what, do="state it, such as density: 1070 kg/m^3")
    nodal = gravity(body, density, np.array([1.0, 0.0, 0.0]))[:, 0]
    nodes = np.flatnonzero(nodal)
    mass = float(nodal.sum())
    shares = nodal[nodes] / mass
    return CentreOfMass(nodes, shares, shares @ body.mesh.X[nodes], mass)
