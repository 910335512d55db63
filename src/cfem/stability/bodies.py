"""Small structured bodies, and robots made of them, without a mesh generator."""

from collections.abc import Callable, Sequence

import numpy as np

from cfem.condensed import Rows
from cfem.constraint.attachment import attach
from cfem.constraint.cable import Cable, make_cable
from cfem.constraint.effector import make_effector
from cfem.constraint.protocol import Constraint, Watched
from cfem.equilibrium.system.robot import Robot
from cfem.mechanics.body import Body, make_body
from cfem.mechanics.element import ELEMENTS
from cfem.mechanics.mass import gravity
from cfem.mechanics.material import LAWS
from cfem.mechanics.material.law import Material
from cfem.mechanics.mesh import HEX_TETS, Mesh, boundary_facets
from cfem.robot.cad import Box
from cfem.robot.mesh import hexahedra
from cfem.robot.mesh.meshing import corners_of, with_middles

BAR = (60.0, 10.0, 10.0)  # mm
COARSE = {"tet4": (8, 2, 2), "tet10": (6, 1, 1), "tet10p0": (6, 1, 1), "hex8": (8, 2, 2)}  # cells of a bar
SOFT = Material(LAWS["neo-hookean"], 1.0, 0.45)


def box(
    size: Sequence[float],
    divisions: Sequence[int],
    element: str = "tet10p0",
    keep: Callable[[np.ndarray], np.ndarray] | None = None,
    bend: Callable[[np.ndarray], np.ndarray] | None = None,
) -> Mesh:
    """[0, size] mm in divisions[0] x [1] x [2] hexahedra, or in six tetrahedra each. keep: of centroids (m, 3), which
    hexahedra there are; bend: corners (n, 3) mm of the box to where they lie at rest."""
    X, cells = hexahedra.block(Box((0.0, 0.0, 0.0), tuple(float(n) for n in divisions)), 1.0)
    X = X * (np.asarray(size, float) / divisions)
    if keep is not None:
        used, cells = np.unique(cells[keep(X[cells].mean(axis=1))], return_inverse=True)
        X, cells = X[used], cells.reshape(-1, 8)
    X = X if bend is None else bend(X)
    if ELEMENTS[element].n_nodes != 8:
        cells = cells[:, HEX_TETS].reshape(-1, 4)
    return in_element(Mesh(X, cells, boundary_facets(cells)), element)


def in_element(mesh: Mesh, element: str) -> Mesh:
    """Mesh of the same cells with the nodes that the element needs: in the middle of every edge of a tetrahedron, or
    none there. A node in the middle is in the node sets that both ends are in."""
    if ELEMENTS[element].order == mesh.order:
        return mesh
    return corners_of(mesh) if mesh.order == 2 else with_middles(mesh)


def cells_where(mesh: Mesh, inside: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Indices of the cells whose centroid (m, 3) lies `inside`."""
    corners = mesh.cells[:, : 8 if mesh.cells.shape[1] == 8 else 4]
    return np.flatnonzero(inside(mesh.X[corners].mean(axis=1)))


def at_low_end(mesh: Mesh) -> np.ndarray:
    """Nodes at the smallest x."""
    return np.flatnonzero(mesh.X[:, 0] < mesh.X[:, 0].min() + 1e-9 * mesh.size)


def cable(
    mesh: Mesh, points: Sequence[Sequence[float]], pull_point: Sequence[float] | None, radius: float = 2.0
) -> Cable:
    attached = [attach(mesh, np.array(point, float), radius, "cable point") for point in points]
    return make_cable(attached, None if pull_point is None else np.array(pull_point, float), "cable")


def watched(mesh: Mesh, point: Sequence[float], radius: float = 2.0, **options) -> Watched:
    return make_effector(mesh, np.array(point, float), radius, 10.0, "tip", **options)


def robot(
    body: Body,
    actuators: Sequence[Constraint],
    effectors: Sequence[Watched],
    fixed: np.ndarray | None = None,
    contacts: Sequence[Constraint] = (),
    unilateral: bool = True,
    **options,
) -> Robot:
    """Held at its low end unless `fixed` says otherwise."""
    names = [f"{number}.{axis}" for number, effector in enumerate(effectors) for axis in range(len(effector.rest))]
    return Robot(
        name="stability",
        body=body,
        fixed=at_low_end(body.mesh) if fixed is None else np.asarray(fixed, dtype=int),
        actuators=tuple(actuators),
        effectors=tuple(effectors),
        rows=Rows(
            tuple(names),
            tuple(f"actuator {number}" for number in range(len(actuators))),
            tuple(f"contact {number}.{axis}" for number in range(len(contacts)) for axis in "xyz"),
        ),
        reach=np.tile([0.0, 10.0], (len(actuators), 1)),
        unilateral=np.full(len(actuators), unilateral),
        length=body.mesh.size,
        contacts=tuple(contacts),
        **options,
    )


def bar_body(
    element: str = "tet10p0",
    law: str = "neo-hookean",
    young: float = 1.0,
    poisson: float = 0.45,
    divisions: Sequence[int] | None = None,
    regions: Sequence[tuple[Callable[[np.ndarray], np.ndarray], float]] = (),
    bend: Callable[[np.ndarray], np.ndarray] | None = None,
) -> Body:
    """The box BAR. regions: (which centroids, how many times `young`)."""
    mesh = box(BAR, divisions or COARSE[element], element, bend=bend)
    parts = [(cells_where(mesh, inside), Material(LAWS[law], factor * young, poisson)) for inside, factor in regions]
    return make_body(mesh, ELEMENTS[element], Material(LAWS[law], young, poisson), parts)


def bar_cables(mesh: Mesh) -> list[Cable]:
    """Two cables of the bar, along its lower and its upper side."""
    return [cable(mesh, [(x, y, z) for x in (15.0, 35.0, 55.0)], (0.0, y, z)) for y, z in ((5.0, 1.0), (3.0, 9.0))]


def bar(body: Body | None = None, weight: float | None = None, **options) -> Robot:
    """A bar held at x = 0 with two cables along it, watched at its end. weight: N, downwards (-z)."""
    body = bar_body() if body is None else body
    if weight is not None:
        options["loads"] = gravity(body, weight / float(np.prod(BAR)), np.array([0.0, 0.0, -1.0]))
    return robot(body, bar_cables(body.mesh), [watched(body.mesh, (60.0, 5.0, 5.0))], **options)
