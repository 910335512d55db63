"""Structured blocks of tetrahedra, and robots made of them, without a mesh generator."""

import itertools

import numpy as np

from cfem.condensed import Rows
from cfem.constraint.attachment import attach
from cfem.constraint.cable import make_cable
from cfem.constraint.contact import make_contact
from cfem.constraint.effector import make_effector
from cfem.equilibrium.system.robot import Robot
from cfem.mechanics.body import Body, make_body
from cfem.mechanics.element import ELEMENTS
from cfem.mechanics.mass import gravity
from cfem.mechanics.material import LAWS
from cfem.mechanics.material.law import Material
from cfem.mechanics.mesh import Mesh, boundary_facets, quadratic, tet_volumes


def block(size, divisions, order=1, distort=0.0, seed=0) -> Mesh:
    """A box [0, size] of divisions[0] x [1] x [2] cubes, each cut into six tetrahedra (Kuhn); interior nodes may be
    moved by `distort` of a cube's edge."""
    size, divisions = np.asarray(size, float), np.asarray(divisions)
    axes = [np.linspace(0, s, n + 1) for s, n in zip(size, divisions, strict=True)]
    X = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    inside = ((X > 1e-9) & (size - 1e-9 > X)).all(axis=1)
    X[inside] += distort * (size / divisions) * np.random.default_rng(seed).uniform(-1, 1, (inside.sum(), 3))
    strides = np.array([(divisions[1] + 1) * (divisions[2] + 1), divisions[2] + 1, 1])
    corner = np.stack(np.meshgrid(*(np.arange(n) for n in divisions), indexing="ij"), axis=-1).reshape(-1, 3) @ strides
    cells = []
    for order_of_axes in itertools.permutations(range(3)):
        path = np.concatenate([[0], np.cumsum(strides[list(order_of_axes)])])
        cells.append(corner[:, None] + path)
    cells = np.concatenate(cells)
    inverted = tet_volumes(X, cells) < 0
    cells[inverted] = cells[inverted][:, [0, 2, 1, 3]]
    facets = boundary_facets(cells)
    if order == 2:
        X, cells, facets = quadratic(X, cells, facets)
    return Mesh(X, cells, facets)


def hexahedra(size, divisions, distort=0.0, seed=0) -> Mesh:
    """A box [0, size] of divisions[0] x [1] x [2] hexahedra, interior nodes moved as in `block`."""
    tets = block(size, divisions, 1, distort, seed)
    nx, ny, nz = divisions
    strides = np.array([(ny + 1) * (nz + 1), nz + 1, 1])
    corner = np.stack(np.meshgrid(*(np.arange(n) for n in (nx, ny, nz)), indexing="ij"), axis=-1).reshape(-1, 3)
    offsets = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
    cells = (corner @ strides)[:, None] + offsets @ strides
    return Mesh(tets.X, cells, boundary_facets(cells))


def box(size, divisions, element: str, distort=0.0) -> Mesh:
    """A structured box in the cells that the element needs."""
    if ELEMENTS[element].n_nodes == 8:
        return hexahedra(size, divisions, distort)
    return block(size, divisions, ELEMENTS[element].order, distort)


def box_body(size, divisions, element="tet10p0", law="neo-hookean", young=1.0, poisson=0.45, distort=0.0) -> Body:
    """One homogeneous box."""
    material = Material(LAWS[law], young, poisson)
    return make_body(box(size, divisions, element, distort), ELEMENTS[element], material)


def bar(
    element="tet10p0",
    law="neo-hookean",
    young=1.0,
    poisson=0.45,
    divisions=(8, 2, 2),
    radius=2.0,
    cables=2,
    contact=False,
    rigid_end=False,
    weight=0.0,
    turn=None,
    shift=(0.0, 0.0, 0.0),
) -> Robot:
    """A 60 x 10 x 10 mm bar along x, held at x = 0, with cables along its lower and upper sides, watched at its end.
    contact: at the middle of its upper side; rigid_end: the last cubes; weight: in N, downwards (-z). All of it, the
    direction of the weight too, turned (3, 3) and then shifted (3,) mm."""
    turn = np.eye(3) if turn is None else turn
    straight = box((60, 10, 10), divisions, element)
    mesh = Mesh(straight.X @ turn.T + shift, straight.cells, straight.facets)
    body = make_body(mesh, ELEMENTS[element], Material(LAWS[law], young, poisson))

    def place(point):
        return turn @ point + shift

    actuators = []
    for index, (y, z) in enumerate([(5.0, 1.0), (3.0, 9.0), (8.0, 8.0)][:cables]):
        points = [attach(mesh, place([x, y, z]), radius, f"cable-{index}") for x in (15.0, 35.0, 55.0)]
        actuators.append(make_cable(points, place([0.0, y, z]), f"cable-{index}"))
    effector = make_effector(mesh, place([60.0, 5.0, 5.0]), radius, 10.0, "tip")
    return Robot(
        name="bar",
        body=body,
        fixed=np.flatnonzero(straight.X[:, 0] < 1e-9),
        actuators=tuple(actuators),
        effectors=(effector,),
        rows=Rows(
            ("tip.x", "tip.y", "tip.z"),
            tuple(f"cable-{i}" for i in range(cables)),
            ("touch.x", "touch.y", "touch.z") if contact else (),
        ),
        reach=np.tile([0.0, 8.0], (cables, 1)),
        unilateral=np.ones(cables, dtype=bool),
        length=60.0,
        contacts=(make_contact(mesh, place([30.0, 5.0, 9.0]), radius, "touch"),) if contact else (),
        rigid=(np.flatnonzero(straight.X[:, 0] > 60 - 60 / divisions[0] - 1e-9),) if rigid_end else (),
        loads=gravity(body, weight / 6000.0, turn @ [0.0, 0.0, -1.0]) if weight else None,
    )
