"""A clip: two legs on a common back, with a gap between them that a cable closes."""

from dataclasses import replace

import numpy as np

from cfem.condensed import Rows
from cfem.constraint.attachment import attach
from cfem.constraint.cable import make_cable
from cfem.constraint.effector import make_effector
from cfem.contact.surface.facing import facing
from cfem.equilibrium.system.robot import Robot
from cfem.mechanics.body import make_body
from cfem.mechanics.element import ELEMENTS
from cfem.mechanics.material import LAWS
from cfem.mechanics.material.law import Material
from cfem.mechanics.mesh import Mesh, boundary_facets, quadratic
from cfem.mechanics.self_contact import POINTS, make_self_contact
from support.blocks import block

GAP = 1.0


def clip(element="tet10", divisions=(8, 1, 7), self_contact=True) -> Robot:
    """Legs of 24 x 3 x 3 mm along x, GAP apart along z, on a back that is held at x = 0. Two cables: one from leg to
    leg at x = 15 mm, and one along the upper leg."""
    plain = block((24, 3, 7), divisions)
    middles = plain.X[plain.cells].mean(axis=1)
    cells = plain.cells[~((np.abs(middles[:, 2] - 3.5) < 0.5) & (middles[:, 0] > 3))]
    used, cells = np.unique(cells, return_inverse=True)
    X, cells = plain.X[used], cells.reshape(-1, 4)
    facets = boundary_facets(cells)
    if ELEMENTS[element].order == 2:
        X, cells, facets = quadratic(X, cells, facets)
    mesh = Mesh(X, cells, facets)
    body = make_body(mesh, ELEMENTS[element], Material(LAWS["neo-hookean"], 1.0, 0.4))
    if self_contact:
        pairs = facing(X, facets[:, :3], POINTS, 1.5 * GAP)
        body = replace(body, contact=make_self_contact(X, facets, pairs, 0.2, body.shear))
    ends = [attach(mesh, np.array([15.0, 1.5, z]), 1.5, "closing") for z in (0.5, 6.5)]
    along = [attach(mesh, np.array([x, 1.5, 6.5]), 1.5, "along") for x in (9.0, 21.0)]
    return Robot(
        name="clip",
        body=body,
        fixed=np.flatnonzero(X[:, 0] < 1e-9),
        actuators=(make_cable(ends, None, "closing"), make_cable(along, np.array([0.0, 1.5, 6.5]), "along")),
        effectors=(make_effector(mesh, np.array([24.0, 1.5, 6.5]), 1.5, 5.0, "tip"),),
        rows=Rows(("tip.x", "tip.y", "tip.z"), ("closing", "along"), ()),
        reach=np.tile([0.0, 3.0], (2, 1)),
        unilateral=np.ones(2, dtype=bool),
        length=24.0,
    )
