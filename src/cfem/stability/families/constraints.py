"""Rows that depend on each other, or on nothing: effectors, contacts, and bodies of one element."""

from functools import partial

import numpy as np

from cfem.constraint.contact import make_contact
from cfem.core.errors import SpecError
from cfem.equilibrium.system.actuation import Actuation, displacement, force
from cfem.equilibrium.system.robot import Robot
from cfem.mechanics.body import make_body
from cfem.mechanics.element import ELEMENTS
from cfem.mechanics.mesh import Mesh, boundary_facets
from cfem.stability.bodies import SOFT, bar, bar_body, bar_cables, cable, in_element, robot, watched
from cfem.stability.case import AWAY, Case, converges, either, named, refuses
from cfem.stability.examine import attempt

TIP, TOUCH, HELD = (60.0, 5.0, 5.0), (45.0, 5.0, 8.0), (0.0, 5.0, 5.0)
PULLED = displacement([4.0, 2.0])
TETRAHEDRON = np.array([[0.0, 0, 0], [0, 10, 0], [0, 0, 10], [10, 2, 2]]), np.array([[0, 1, 2, 3]])
CUBE = (
    np.array([[0.0, 0, 0], [10, 0, 0], [10, 10, 0], [0, 10, 0], [0, 0, 10], [10, 0, 10], [10, 10, 10], [0, 10, 10]]),
    np.arange(8)[None],
)
ONE = {  # with the effector at the cable's point
    "force": (force([0.2]), converges("semidefinite")),
    "2 mm": (displacement([2.0]), converges("semidefinite")),
    "9 mm": (displacement([9.0]), either(*AWAY, definite="semidefinite")),
}


SEMIDEFINITE = converges("semidefinite")


def cases() -> list[Case]:
    """Cases of effectors, contacts and single elements."""
    return [*_effector_cases(), *_contact_cases(), *_single_elements()]


def _effector_cases() -> list[Case]:
    """Effectors alike, on a line, in the held region, outside the body."""
    return [
        Case("effectors/two alike", SEMIDEFINITE, attempt(partial(_effectors, [TIP, TIP]), PULLED)),
        Case(
            "effectors/four on a line",
            SEMIDEFINITE,
            attempt(partial(_effectors, [(x, 5.0, 5.0) for x in (50.0, 52.0, 54.0, 56.0)], 0.0), PULLED),
        ),
        Case("effectors/in the held region", SEMIDEFINITE, attempt(partial(_effectors, [TIP, HELD], 0.0), PULLED)),
        Case(
            "effectors/next to the held region",
            converges(),
            attempt(partial(_effectors, [TIP, (3.0, 5.0, 5.0)]), PULLED),
        ),
        Case("effectors/outside the body", converges(), attempt(partial(_effectors, [(66.0, 5.0, 5.0)]), PULLED)),
        Case("effectors/far outside the body", refuses(SpecError, "outside"), partial(_effectors, [(600.0, 5.0, 5.0)])),
        Case("effectors/with orientation", converges(), attempt(partial(_effectors, [TIP], orientation=True), PULLED)),
        Case(
            "effectors/two orientations alike",
            SEMIDEFINITE,
            attempt(partial(_effectors, [TIP, TIP], orientation=True), PULLED),
        ),
    ]


def _contact_cases() -> list[Case]:
    """Contacts free, held, pushed, alike, in the held region, outside the body."""
    return [
        Case("contacts/free", converges(), attempt(partial(_contacts, [TOUCH]), PULLED)),
        Case(
            "contacts/held where it is", converges(), attempt(partial(_contacts, [TOUCH]), _all([3.0, 0.0], [0.0] * 3))
        ),
        Case(
            "contacts/pushed by 5 mm",
            converges(),
            attempt(partial(_contacts, [TOUCH]), _all([0.0, 0.0], [0.0, 0.0, -5.0])),
        ),
        Case(
            "contacts/pushed by a metre",
            named(*AWAY),
            attempt(partial(_contacts, [TOUCH]), _all([0.0, 0.0], [0.0, 0.0, -1e3])),
        ),
        Case("contacts/on top of each other, free", SEMIDEFINITE, attempt(partial(_contacts, [TOUCH, TOUCH]), PULLED)),
        Case(
            "contacts/on top of each other, held",
            named("SINGULAR"),
            attempt(partial(_contacts, [TOUCH, TOUCH]), _all([3.0, 0.0], [0.0] * 6)),
        ),
        Case(
            "contacts/on top of each other, pulled apart",
            named("SINGULAR"),
            attempt(partial(_contacts, [TOUCH, TOUCH]), _all([3.0, 0.0], [1.0, 0, 0, 0, 0, 0])),
        ),
        Case(
            "contacts/four, more than there are motions of a rigid end",
            named("SINGULAR"),
            attempt(
                partial(_contacts, [(x, y, 5.0) for x in (52.0, 58.0) for y in (3.0, 7.0)], rigid=True),
                _all([3.0, 0.0], [0.0] * 12),
            ),
        ),
        Case("contacts/in the held region, free", SEMIDEFINITE, attempt(partial(_contacts, [HELD], 0.0), PULLED)),
        Case(
            "contacts/in the held region, held",
            named("SINGULAR"),
            attempt(partial(_contacts, [HELD], 0.0), _all([3.0, 0.0], [0.0] * 3)),
        ),
        Case(
            "contacts/in the held region, moved",
            named("SINGULAR"),
            attempt(partial(_contacts, [HELD], 0.0), _all([3.0, 0.0], [0.0, 0.0, 1.0])),
        ),
        Case("contacts/at the effector", SEMIDEFINITE, attempt(partial(_contacts, [TIP]), PULLED)),
        Case("contacts/outside the body", refuses(SpecError, "outside"), partial(_contacts, [(30.0, 50.0, 5.0)])),
    ]


def _single_elements() -> list[Case]:
    """Bodies of one element."""
    return [
        Case(f"one element/{element}/{how}", expect, attempt(partial(_one, element), actuation))
        for element in ELEMENTS
        for how, (actuation, expect) in ONE.items()
    ]


def _all(delta_a: list[float], delta_c: list[float]) -> Actuation:
    """Actuators and contacts displaced."""
    return displacement(np.array([*delta_a, *delta_c]))


def _effectors(points: list, radius: float = 2.0, **options) -> Robot:
    body = bar_body()
    mesh = body.mesh
    return robot(body, bar_cables(mesh), [watched(mesh, point, radius, **options) for point in points])


def _contacts(points: list, radius: float = 2.0, rigid: bool = False) -> Robot:
    body = bar_body()
    contacts = [make_contact(body.mesh, np.array(point), radius, "touch") for point in points]
    groups = (np.flatnonzero(body.mesh.X[:, 0] > 49.0),) if rigid else ()
    return bar(body, contacts=contacts, rigid=groups)


def _one(element: str) -> Robot:
    """Robot of one cell, held at x = 0, its far corner drawn sideways."""
    X, cells = CUBE if ELEMENTS[element].n_nodes == 8 else TETRAHEDRON
    mesh = in_element(Mesh(X, cells, boundary_facets(cells)), element)
    corner = mesh.X[cells[0, 6]] if len(cells[0]) == 8 else mesh.X[cells[0, 3]]
    sideways = cable(mesh, [corner], corner + [-5.0, 0.0, 20.0], radius=0.0)
    return robot(make_body(mesh, ELEMENTS[element], SOFT), [sideways], [watched(mesh, corner, radius=0.0)])
