"""A block as large as a half space to what presses the middle of its top, meshed finely there."""

import numpy as np

from cfem.condensed import Rows
from cfem.constraint.surface import outer_surface
from cfem.constraint.surface_points import around_nodes, at_nodes
from cfem.equilibrium.contact.skinned_robot import SkinnedRobot
from cfem.equilibrium.system.robot import Robot
from cfem.mechanics.body import make_body
from cfem.mechanics.element import ELEMENTS
from cfem.mechanics.material import LAWS
from cfem.mechanics.material.law import Material
from cfem.mechanics.mesh import Mesh, boundary_facets, quadratic
from cfem.robot.cad import Box, as_data
from cfem.robot.mesh.ask_gmsh import ask_gmsh


def half_space(core, size, far, element="tet10", growth=0.35, poisson=0.3) -> Robot:
    """Below z = 0, `far` mm to each side and down, where it is held: tetrahedra of `size` mm up to `core` mm from the
    origin, beyond that larger by `growth` of the distance. Young's modulus 1 MPa."""
    fine = {"low": [-core] * 3, "high": [core, core, 0.0], "size": size, "blend": far}
    solid = Box((-far, -far, -far), (far, far, 0.0))
    job = {"solid": as_data(solid), "size": size + growth * far, "refine": [fine], "regions": [], "max_cells": 1e6}
    answer = ask_gmsh(job, solid)
    X, cells = answer["X"], answer["cells"]
    facets = boundary_facets(cells)
    if ELEMENTS[element].order == 2:
        X, cells, facets = quadratic(X, cells, facets)
    body = make_body(Mesh(X, cells, facets), ELEMENTS[element], Material(LAWS["neo-hookean"], 1.0, poisson))
    held = (np.abs(X[:, :2]).max(axis=1) > far - 1e-6) | (X[:, 2] < 1e-6 - far)
    return block_robot(body, np.flatnonzero(held), core)


def block_robot(body, held, length, **more) -> Robot:
    """A body without actuators, held at some nodes."""
    none = np.zeros((0, 2)), np.zeros(0, dtype=bool)
    return Robot("block", body, held, (), (), Rows((), ()), *none, length, **more)


def skinned(robot, points="around", **pose) -> SkinnedRobot:
    """The body that touches at its nodes, or by averages around them."""
    surface = outer_surface(robot.X, robot.body.mesh.facets)
    make = {"around": around_nodes, "nodes": at_nodes}[points]
    chosen = make(robot.X, robot.body.mesh.facets, surface)
    return SkinnedRobot(robot, surface.nodes, surface.triangles, chosen, itself=False, **pose)
