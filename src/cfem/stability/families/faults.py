"""Bodies that no mesh should be, bodies that nothing holds, and numbers that are none."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from cfem.constraint.attachment import attach
from cfem.constraint.cavity import enclosed, make_cavity
from cfem.core.errors import InputError, SpecError
from cfem.equilibrium.system.actuation import displacement, force
from cfem.equilibrium.system.robot import Robot
from cfem.equilibrium.system.solution import State
from cfem.mechanics.body import make_body
from cfem.mechanics.element import ELEMENTS
from cfem.mechanics.mesh import Mesh, boundary_facets
from cfem.stability.bodies import BAR, COARSE, SOFT, bar, bar_body, bar_cables, box, in_element, robot, watched
from cfem.stability.case import Case, converges, either, named, refuses
from cfem.stability.examine import attempt
from cfem.stability.families.chambers import SIZE, hollow_mesh

NAN, INF = float("nan"), float("inf")
LOOSE = {  # nodes (n, 3) that are held
    "by nothing": lambda X: np.zeros(len(X), dtype=bool),
    "at one point": lambda X: np.linalg.norm(X, axis=1) < 1e-9,
    "at one edge": lambda X: np.linalg.norm(X[:, :2], axis=1) < 1e-9,
}
GENTLE = force([1e-3, 0.0])


SINGULAR, UNREAL = named("SINGULAR"), named("NOT_FINITE")


def cases() -> list[Case]:
    """Cases of bodies, numbers and starts that are wrong, or nearly so."""
    return [*_loose(), *_bad_bodies(), *_not_finite(), *_bad_stiffness_and_starts()]


def _loose() -> list[Case]:
    """Bodies that are not held enough."""
    return [
        Case(f"faults/held {how}/{element}/{kind}", expect, attempt(partial(_held, how, element), actuation))
        for how in LOOSE
        for element in ELEMENTS
        for kind, actuation, expect in (("at rest", force([0.0, 0.0]), SINGULAR), ("drawn", GENTLE, either("SINGULAR")))
    ] + [
        Case(
            f"faults/held {how}/displaced", SINGULAR, attempt(partial(_held, how, "tet10p0"), displacement([2.0, 1.0]))
        )
        for how in LOOSE
    ]


def _bad_bodies() -> list[Case]:
    """Bodies, cavities and cable points that no robot can have."""
    return [
        Case(
            "faults/a second body that nothing holds", SINGULAR, attempt(partial(_pieces, _second), force([0.0, 0.0]))
        ),
        Case("faults/two halves that share an edge", SINGULAR, attempt(partial(_pieces, _hinged), force([0.0, 0.0]))),
        Case("faults/a node of no cell", refuses(InputError, "no cell"), attempt(_lonely, GENTLE)),
        *(
            Case(f"faults/inverted cell/{element}", refuses(InputError, "inverted"), partial(_spoilt, element, -1.0))
            for element in ELEMENTS
        ),
        *(
            Case(f"faults/flat cell/{element}", refuses(InputError, "flat"), partial(_spoilt, element, 0.0))
            for element in ELEMENTS
        ),
        Case("faults/mesh of NaN", refuses(InputError, "finite"), partial(_spoilt, "tet10p0", NAN)),
        *(
            Case(f"faults/open cavity/{element}", refuses(SpecError, "not closed"), partial(_open_cavity, element))
            for element in ELEMENTS
        ),
        Case("faults/cavity in the material", refuses(SpecError, "in the material"), _no_cavity),
        Case("faults/cavity without volume", refuses(SpecError, "no volume"), _flat_cavity),
        Case(
            "faults/cable point outside the body",
            refuses(SpecError, "outside the body"),
            partial(_attached, (30.0, 5.0, 40.0), 2.0),
        ),
        Case(
            "faults/cable point beside the body, no radius",
            refuses(SpecError, "outside the body"),
            partial(_attached, (30.0, 5.0, 10.2), 0.0),
        ),
        Case(
            "faults/cable point of NaN",
            refuses(SpecError, "finite"),
            partial(_attached, (NAN, 5.0, 5.0), 2.0),
        ),
    ]


def _not_finite() -> list[Case]:
    """Numbers that are not finite."""
    return [
        Case(f"not finite/{label}", UNREAL, attempt(make, actuation, start=start))
        for label, make, actuation, start in (
            ("displacement NaN", bar, displacement([NAN, 1.0]), None),
            ("displacement infinite", bar, displacement([INF, 1.0]), None),
            ("force NaN", bar, force([NAN, 1.0]), None),
            ("force infinite", bar, force([INF, 1.0]), None),
            ("start of NaN", bar, displacement([2.0, 1.0]), _start(NAN, 0.0)),
            ("start of infinite forces", bar, displacement([2.0, 1.0]), _start(0.0, INF)),
            ("weight NaN", partial(_heavy, NAN), GENTLE, None),
            ("weight infinite", partial(_heavy, INF), GENTLE, None),
            ("load share NaN", partial(bar, weight=1.0), replace(GENTLE, load=NAN), None),
        )
    ]


def _bad_stiffness_and_starts() -> list[Case]:
    """Moduli that no material has, and starts far from any equilibrium."""
    return [
        Case(f"faults/stiffness {young:g}", refuses(InputError, "moduli"), partial(_of_young, young))
        for young in (0.0, -1.0, NAN, INF)
    ] + [
        Case(f"faults/start from {label}", converges(), attempt(bar, displacement([4.0, 2.0]), start=start))
        for label, start in (
            ("rest", _start(0.0, 0.0)),
            ("noise", _start(1.0, 0.0)),
            ("absurd forces", _start(0.0, 1e12)),
            ("a mirror image", lambda made: State(made.body.mesh.X * [-1, 1, 1], np.empty(0), np.zeros(2))),
        )
    ]


def _start(x: float, lam: float) -> Callable[[Robot], State]:
    """Positions off by noise of x times the body's size (all NaN where x is), and multipliers lam."""

    def start(robot: Robot) -> State:
        X = robot.body.mesh.X
        noise = np.random.default_rng(0).standard_normal(X.shape) * robot.body.mesh.size
        return State(X + x * noise, np.empty(0), np.full(2, lam))

    return start


def _of_young(young: float) -> Robot:
    return bar(bar_body(young=young))


def _heavy(force_on_each: float) -> Robot:
    """Bar with this force N on every node, downwards."""
    body = bar_body()
    loads = np.zeros_like(body.mesh.X)
    loads[:, 2] = -force_on_each
    return bar(body, loads=loads)


def _held(how: str, element: str) -> Robot:
    body = bar_body(element)
    return bar(body, fixed=np.flatnonzero(LOOSE[how](body.mesh.X)))


def _pieces(join: Callable[[Mesh], Mesh]) -> Robot:
    mesh = in_element(join(box(BAR, COARSE["tet4"], "tet4")), "tet10p0")
    body = make_body(mesh, ELEMENTS["tet10p0"], SOFT)
    return robot(body, bar_cables(mesh), [watched(mesh, (59.0, 5.0, 5.0))])


def _second(mesh: Mesh) -> Mesh:
    """The mesh with a second bar like it, 20 mm beside."""
    n = len(mesh.X)
    return Mesh(
        np.vstack([mesh.X, mesh.X + [5.0, 20.0, 0.0]]),
        np.vstack([mesh.cells, mesh.cells + n]),
        np.vstack([mesh.facets, mesh.facets + n]),
    )


def _hinged(mesh: Mesh) -> Mesh:
    """The mesh with another bar at its end, joined along the edge x = 60, z = 0 alone."""
    twin = mesh.X * [1, 1, -1] + [60.0, 0.0, 0.0]
    cells = mesh.cells[:, [0, 2, 1, 3]] + len(mesh.X)
    X = np.vstack([mesh.X, twin])
    apart = np.linalg.norm(X[:, None] - X[None], axis=2)
    same = (apart < 1e-9).argmax(axis=1)
    edge = np.linalg.norm(X[:, [0, 2]] - [60.0, 0.0], axis=1) < 1e-9
    number = np.where(edge, same, np.arange(len(X)))
    used, cells = np.unique(number[np.vstack([mesh.cells, cells])], return_inverse=True)
    cells = cells.reshape(-1, 4)
    return Mesh(X[used], cells, boundary_facets(cells))


def _lonely() -> Robot:
    mesh = box(BAR, COARSE["tet4"], "tet4")
    mesh = replace(mesh, X=np.vstack([mesh.X, [30.0, 30.0, 30.0]]))
    return bar(make_body(mesh, ELEMENTS["tet4"], SOFT))


def _spoilt(element: str, height: float):
    """A bar one of whose corners is moved through (-1), into (0) the opposite face of a cell there, or to nowhere."""
    mesh = box(BAR, (6, 1, 1), "hex8" if element == "hex8" else "tet4")
    cell = mesh.cells[0]
    X = mesh.X.copy()
    if element == "hex8":
        moved, foot = cell[[0, 1, 2, 3]], X[cell[[4, 5, 6, 7]]]
        X[moved] = foot + height * (X[moved] - foot)
    else:
        foot = X[cell[1:4]].mean(axis=0)
        X[cell[0]] = foot + height * (X[cell[0]] - foot)
    return make_body(in_element(replace(mesh, X=X), element), ELEMENTS[element], SOFT)


def _open_cavity(element: str):
    mesh = hollow_mesh(element)
    walls = enclosed(mesh, np.array(SIZE) / 2)
    return make_cavity(mesh.X, mesh.facets[walls[1:]], "chamber")


def _no_cavity():
    mesh = box(BAR, COARSE["tet4"], "tet4")
    return make_cavity(mesh.X, mesh.facets[enclosed(mesh, np.array([30.1, 5.2, 4.7]))], "chamber")


def _flat_cavity():
    mesh = hollow_mesh("tet4")
    return make_cavity(mesh.X * [1.0, 1.0, 0.0], mesh.facets[enclosed(mesh, np.array(SIZE) / 2)], "chamber")


def _attached(point: tuple[float, float, float], radius: float):
    return attach(box(BAR, COARSE["tet4"], "tet4"), np.array(point), radius, "cable point")
