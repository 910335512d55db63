"""Rods of rigid sections along x, held at x = 0, as bodies and as problems, and bending by closed forms."""

import numpy as np
from scipy.integrate import solve_bvp

from cfem.condensed import Rows
from cfem.constraint.effector import PointEffector
from cfem.constraint.section_point import attach_to_sections
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.robot import Robot
from cfem.mechanics.body import make_rod_body
from cfem.mechanics.element import SECTIONED
from cfem.mechanics.material import LAWS
from cfem.mechanics.material.law import Material
from cfem.mechanics.mesh import Mesh, boundary_facets
from cfem.mechanics.rod.region import CrossSection
from cfem.mechanics.rod.sections import Sections

LENGTH = 100.0
SHAPE = CrossSection(4.0, 4 / 3, 8 / 3)
MATERIAL = Material(LAWS["corotational"], 2.0, 0.0)


def rod_body(elements):
    """A square rod of half width 1 mm, four nodes a section."""
    places = np.linspace(0.0, LENGTH, elements + 1)
    corners = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    X = np.concatenate([np.column_stack([np.full(4, x), corners]) for x in places])
    first = np.array([0, 4, 5, 1, 3, 7, 6, 2])
    cells = first + 4 * np.arange(elements)[:, None]
    sections = Sections(X, np.arange(len(X)).reshape(-1, 4))
    return make_rod_body(Mesh(X, cells, boundary_facets(cells)), SECTIONED["beam"], sections, SHAPE, MATERIAL)


def rod_problem(elements, actuators, loads=None):
    """actuators: body -> constraints."""
    body = rod_body(elements)
    sections = list(body.sections.nodes)
    tip = PointEffector(attach_to_sections(body.mesh.X, sections, np.array([LENGTH, 0.0, 0.0]), "tip"))
    rows = actuators(body)
    n = len(rows)
    robot = Robot(
        "rod",
        body,
        sections[0],
        tuple(rows),
        (tip,),
        Rows(("tip.x", "tip.y", "tip.z"), tuple(f"a{i}" for i in range(n))),
        np.tile([0.0, 1.0], (n, 1)),
        np.zeros(n, dtype=bool),
        LENGTH,
        rigid=tuple(sections[1:]),
        loads=None if loads is None else loads(body),
    )
    return Problem(robot)


def elastica(force, bending, length):
    """(x, y) of the end of an inextensible, unshearable cantilever under a dead force across, by a boundary value
    solver: EI theta'' = -F cos theta."""

    def equations(s, y):
        return np.array([y[1], -force / bending * np.cos(y[0]), np.cos(y[0]), np.sin(y[0])])

    def ends(a, b):
        return np.array([a[0], b[1], a[2], a[3]])

    s = np.linspace(0.0, length, 50)
    start = np.array([s / length, np.full(50, 1 / length), s, s / 2])
    return solve_bvp(equations, ends, s, start, tol=1e-10, max_nodes=100_000).sol(length)[2:]
