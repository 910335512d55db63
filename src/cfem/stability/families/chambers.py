"""A hollow block blown up, by pressure and by volume, at its working pressure and at ten times that; and emptied (its
walls may pass through each other: nothing here knows of contact between them)."""

from functools import partial
from itertools import product

import numpy as np

from cfem.constraint.cavity import enclosed, make_cavity
from cfem.equilibrium.system.actuation import Actuation, displacement, force
from cfem.equilibrium.system.robot import Robot
from cfem.mechanics.body import make_body
from cfem.mechanics.element import ELEMENTS
from cfem.mechanics.material import LAWS
from cfem.mechanics.material.law import Material
from cfem.mechanics.mesh import Mesh
from cfem.stability.bodies import box, robot, watched
from cfem.stability.case import AWAY, Case, Expectation, converges, either, named
from cfem.stability.examine import attempt

SIZE, VOID = (30.0, 20.0, 20.0), (18.0, 12.0, 12.0)  # mm
CELLS = {"tet4": 5, "tet10": 3, "tet10p0": 3, "hex8": 5}  # along each side; one through each wall
WORKING = 0.05  # MPa, on walls of 1 MPa
GROWTH = 200.0  # mm^3 at about that pressure
PRESSURES: dict[str, tuple[float, Expectation]] = {
    "working pressure": (WORKING, converges()),
    "10x working pressure": (10 * WORKING, either(*AWAY)),
    "1000x working pressure": (1000 * WORKING, either(*AWAY)),
    "suction": (-WORKING, converges()),
    "10x suction": (-10 * WORKING, either(*AWAY)),
}
VOLUMES: dict[str, tuple[float, Expectation]] = {
    "working volume": (GROWTH, converges()),
    "10x working volume": (10 * GROWTH, either(*AWAY)),
    "half emptied": (-0.5 * float(np.prod(VOID)), either(*AWAY)),
    "emptied to nothing": (-float(np.prod(VOID)), either(*AWAY)),
    "emptied further": (-2 * float(np.prod(VOID)), named(*AWAY)),
}


def cases() -> list[Case]:
    """Cases of the hollow block for each element, pressure and volume."""
    actuations: list[tuple[str, Actuation, Expectation]] = [
        *((label, force([value]), expect) for label, (value, expect) in PRESSURES.items()),
        *((label, displacement([value]), expect) for label, (value, expect) in VOLUMES.items()),
    ]
    return [
        Case(f"chambers/{label}/{element}", expect, attempt(partial(hollow, element), actuation))
        for element, (label, actuation, expect) in product(ELEMENTS, actuations)
    ]


def hollow_mesh(element: str) -> Mesh:
    """Mesh of a block with a void, its cells drawn to the walls."""
    size, wall = np.array(SIZE), (np.array(SIZE) - VOID) / 2
    cell = size / CELLS[element]

    def at_the_rim(centroids: np.ndarray) -> np.ndarray:
        return ((centroids < cell) | (centroids > size - cell)).any(axis=1)

    def to_walls(X: np.ndarray) -> np.ndarray:
        stops = [np.array([[0 * w, w, s - w, s] for w, s in zip(inner, size, strict=True)]) for inner in (cell, wall)]
        return np.column_stack([np.interp(X[:, axis], stops[0][axis], stops[1][axis]) for axis in range(3)])

    return box(SIZE, [CELLS[element]] * 3, element, keep=at_the_rim, bend=to_walls)


def hollow(element: str) -> Robot:
    """Robot of 30 x 20 x 20 mm with a void of 18 x 12 x 12 mm."""
    mesh = hollow_mesh(element)
    body = make_body(mesh, ELEMENTS[element], Material(LAWS["neo-hookean"], 1.0, 0.45))
    walls = mesh.facets[enclosed(mesh, np.array(SIZE) / 2)]
    chamber = make_cavity(mesh.X, walls, "chamber")
    return robot(body, [chamber], [watched(mesh, (29.0, 10.0, 10.0))], unilateral=False)
